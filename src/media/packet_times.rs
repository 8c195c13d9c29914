//! Times of copied packets, made such that every muxer takes them.
//!
//! A muxer wants decoding times that increase and are not after the display times. One packet that breaks this rule would end
//! the whole job, so it gets a time between its neighbors or is left out. Rules, in units of the result's stream:
//!
//! 1. No time at all, or one outside the clip by more than [`MARGIN_US`]: sound follows its predecessor; anything else is left
//!    out, as nothing says where it belongs.
//! 2. Sound that is later than the packet behind it: the same. Sound comes without gaps of its own making, so one packet is
//!    held back until the next one shows whether its time was a jump of the clip or a fault of the packet.
//! 3. Not after its predecessor: sound follows the predecessor, everything else takes its time.
//! 4. A display time before the decoding time, or far behind it, is the decoding time.

use super::av::{Kind, Packet, Rational};

/// How far outside the clip a time may be, µs: containers differ in where they begin, and sound outlasts pictures.
const MARGIN_US: i64 = 60_000_000;

/// The times of one stream.
pub(super) struct PacketTimes {
    sound: bool,
    video: bool,
    /// Times may repeat: subtitles, and containers that allow it.
    repeats: bool,
    /// Times that are possible, and the farthest a display time may be behind its decoding time; ticks.
    window: (i64, i64),
    reorder: i64,
    /// Decoding time of the last packet, and where that ends.
    last: Option<(i64, i64)>,
    held: Option<Packet>,
    /// Packets whose time was changed.
    pub(super) repaired: u64,
    /// Packets that were left out.
    pub(super) dropped: u64,
}

impl PacketTimes {
    /// Of a stream of `kind` with times in `base`, in a clip of `duration_us`.
    pub(super) fn new(kind: Kind, base: Rational, duration_us: Option<i64>, strict: bool) -> Self {
        let ticks = |us: i64| Rational::MICRO.rescale(us, base);
        let end = duration_us.map_or(i64::MAX / 4, |d| ticks(d.saturating_add(MARGIN_US)));
        Self {
            sound: kind == Kind::Audio,
            video: kind == Kind::Video,
            repeats: !strict || matches!(kind, Kind::Subtitle | Kind::Data),
            window: (ticks(-MARGIN_US), end.min(i64::MAX / 4)),
            reorder: ticks(MARGIN_US),
            last: None,
            held: None,
            repaired: 0,
            dropped: 0,
        }
    }

    /// The next packet of the stream; gives the one that can be written now, if any.
    pub(super) fn push(&mut self, packet: Packet) -> Option<Packet> {
        if !self.sound {
            return self.mend(packet, None);
        }
        let next = packet.dts().or(packet.pts()).filter(|t| self.is_possible(*t));
        let held = self.held.replace(packet)?;
        self.mend(held, next)
    }

    /// The packet that was held back, after the last one.
    pub(super) fn flush(&mut self) -> Option<Packet> {
        let held = self.held.take()?;
        self.mend(held, None)
    }

    fn is_possible(&self, time: i64) -> bool {
        (self.window.0..=self.window.1).contains(&time)
    }

    fn mend(&mut self, mut packet: Packet, next: Option<i64>) -> Option<Packet> {
        let given = (packet.pts(), packet.dts());
        if self.video && given.1.is_none() && given.0.is_some_and(|pts| self.is_possible(pts)) {
            return Some(packet); // muxers find the decoding times of the first reordered pictures themselves
        }
        let time = given.1.or(given.0).filter(|t| self.is_possible(*t));
        let follows = self.last.map_or(0, |(_, end)| end);
        let first = self.last.map(|(last, _)| if self.repeats { last } else { last + 1 });
        // Rule 2, where the next packet is in order itself.
        let jumped = time.zip(next).is_some_and(|(t, n)| t > n && self.last.is_none_or(|(last, _)| n > last));
        let dts = match time.filter(|_| !jumped) {
            Some(time) if first.is_none_or(|first| time >= first) => time,
            Some(_) if !self.sound => first?,
            _ if self.sound => {
                let at = next.filter(|_| jumped).map_or(follows, |next| follows.min(next - 1));
                if first.is_some_and(|first| at < first) {
                    self.dropped += 1;
                    return None;
                }
                at
            }
            _ => {
                self.dropped += 1;
                return None;
            }
        };
        let shift = time.map_or(0, |t| dts - t);
        let pts = match given.0 {
            Some(pts) if self.is_possible(pts) => {
                let moved = pts + shift;
                if (dts..=dts + self.reorder).contains(&moved) { moved } else { dts }
            }
            _ => dts,
        };
        if !(0..=i64::from(i32::MAX)).contains(&packet.duration()) {
            packet.set_duration(0);
        }
        // A missing time that is filled in from the other one is no repair.
        let changed = given.1.map_or_else(|| given.0 != Some(dts), |d| d != dts) || given.0.is_some_and(|p| p != pts);
        self.repaired += u64::from(changed);
        packet.set_times(Some(pts), Some(dts));
        self.last = Some((dts, dts + packet.duration().max(1)));
        Some(packet)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MILLI: Rational = Rational { num: 1, den: 1000 };

    /// Times of packets of 20 ms after they went through, with the counts.
    fn mended(kind: Kind, times: &[Option<i64>]) -> (Vec<i64>, u64, u64) {
        let mut stream = PacketTimes::new(kind, MILLI, Some(1_000_000), true);
        let mut out = Vec::new();
        for time in times {
            let mut packet = Packet::new();
            packet.set_times(*time, *time);
            packet.set_duration(20);
            out.extend(stream.push(packet));
        }
        out.extend(stream.flush());
        (out.iter().filter_map(Packet::dts).collect(), stream.repaired, stream.dropped)
    }

    #[test]
    fn one_odd_time_in_sound_is_repaired_whatever_it_is() {
        let whole = [-20, 0, 20, 40, 60];
        assert_eq!(mended(Kind::Audio, &whole.map(Some)), (whole.to_vec(), 0, 0));
        for odd in
            [None, Some(0), Some(-20), Some(700), Some(41), Some(i64::MAX - 1), Some(i64::MIN + 1), Some(-70_000)]
        {
            let times = [Some(-20), Some(0), odd, Some(40), Some(60)];
            let (out, repaired, dropped) = mended(Kind::Audio, &times);
            assert_eq!((out, repaired, dropped), (whole.to_vec(), 1, 0), "{odd:?}");
        }
    }

    #[test]
    fn gaps_stay_and_times_that_go_back_follow_on() {
        let gap = [0, 20, 500, 520];
        assert_eq!(mended(Kind::Audio, &gap.map(Some)), (gap.to_vec(), 0, 0));
        let (out, repaired, dropped) = mended(Kind::Audio, &[0, 20, 500, 40, 60, 80].map(Some));
        assert_eq!((out, repaired, dropped), (vec![0, 20, 39, 40, 60, 80], 1, 0));
        let back = mended(Kind::Audio, &[100, 120, 0, 20].map(Some)).0;
        assert!(back.is_sorted_by(|a, b| a < b), "{back:?}");
    }

    #[test]
    fn subtitles_without_a_place_are_left_out_and_others_stay_in_order() {
        let times = [Some(100), None, Some(i64::MAX - 1), Some(90), Some(100), Some(800)];
        assert_eq!(mended(Kind::Subtitle, &times), (vec![100, 100, 100, 800], 1, 2));
    }
}
