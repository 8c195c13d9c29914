//! What the bars of the studio measure: CPU time and memory of this process, and how a figure is printed.

use std::error::Error;
use std::time::{Duration, Instant};

/// An interval that is being measured.
#[derive(Clone, Copy)]
pub(crate) struct Started {
    cpu: Duration,
    wall: Instant,
}

/// A measured interval.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spent {
    /// Of all threads of this process.
    pub(crate) cpu: Duration,
    pub(crate) wall: Duration,
}

impl Started {
    pub(crate) fn now() -> Self {
        Self { cpu: cpu(), wall: Instant::now() }
    }

    pub(crate) fn spent(self) -> Spent {
        Spent { cpu: cpu().saturating_sub(self.cpu), wall: self.wall.elapsed() }
    }
}

/// CPU time of this process.
fn cpu() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Duration::new(time.tv_sec.unsigned_abs(), u32::try_from(time.tv_nsec).unwrap_or(0))
}

/// The `q`-quantiles of CPU and wall time, each on its own.
pub(crate) fn quantile(times: &[Spent], q: f64) -> Spent {
    let of = |part: fn(&Spent) -> Duration| {
        let mut sorted: Vec<Duration> = times.iter().map(part).collect();
        sorted.sort_unstable();
        sorted[((sorted.len() - 1) as f64 * q).round() as usize]
    };
    Spent { cpu: of(|t| t.cpu), wall: of(|t| t.wall) }
}

pub(crate) fn report(what: &str, time: Spent) {
    println!("{what:<36} {:8.1} ms CPU {:8.1} ms wall", ms(time.cpu), ms(time.wall));
}

pub(crate) fn ms(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

/// Memory of this process now, and the most it had since the last report.
pub(crate) fn report_memory() -> Result<(), Box<dyn Error>> {
    println!("memory, now                          {:8.1} MB", status("VmRSS:")?);
    println!("memory, peak since the last report   {:8.1} MB", status("VmHWM:")?);
    // Sets the peak to what is used now (proc(5)).
    Ok(std::fs::write("/proc/self/clear_refs", "5")?)
}

/// A line of the kernel's status of this process, MB.
fn status(name: &str) -> Result<f64, Box<dyn Error>> {
    let text = std::fs::read_to_string("/proc/self/status")?;
    let line = text.lines().find(|line| line.starts_with(name)).ok_or("no such line")?;
    // The kernel's kB are 1024 bytes.
    Ok(line.split_whitespace().nth(1).ok_or("no size")?.parse::<f64>()? * 1024.0 / 1e6)
}
