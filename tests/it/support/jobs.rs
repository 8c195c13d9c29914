//! Short runs of the commands that write, for tests of what is left after ends of every sort.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::ErrorKind;
use std::path::Path;
use std::process::Command;
use std::sync::OnceLock;

use super::clips::{make, shaky};
use super::program::command;

/// A run of the program.
pub(crate) struct WritingJob {
    pub(crate) name: &'static str,
    args: &'static [&'static str],
}

/// A clip, a clip to pictures, its motion, a photo, meshes, a matrix and a batch.
pub(crate) const JOBS: [WritingJob; 8] = [
    WritingJob { name: "clip", args: &["stabilize", "a.mkv", "-o", "out.mp4", "--preset", "ultrafast"] },
    WritingJob { name: "pictures", args: &["stabilize", "a.mkv", "-o", "frames/%03d.png"] },
    WritingJob { name: "motion", args: &["motion", "a.mkv", "-o", "motion.json", "--csv", "motion.csv"] },
    WritingJob { name: "photo", args: &["retarget", "p.png", "-o", "out.png", "--size", "60x120"] },
    WritingJob { name: "mesh", args: &["skeleton", "m.ply", "-o", "rig.json"] },
    WritingJob { name: "conversion", args: &["mesh", "convert", "m.ply", "-o", "m.obj"] },
    WritingJob { name: "system", args: &["solve", "a.mtx", "-o", "x.mtx", "--picture", "fill.png"] },
    WritingJob {
        name: "batch",
        args: &["retarget", "p.png", "q.png", "--out-dir", "narrow", "--size", "60x120", "--progress", "plain"],
    },
];

impl WritingJob {
    /// The job of this name.
    pub(crate) fn named(name: &str) -> &'static Self {
        JOBS.iter().find(|job| job.name == name).expect("a job of the table")
    }

    /// The program with the job's arguments, in a folder of inputs.
    pub(crate) fn command(&self, folder: &Path) -> Command {
        command(folder, self.args)
    }
}

/// Puts the inputs of all jobs into `folder`: the same bytes each time, so that results can be compared.
pub(crate) fn make_inputs(folder: &Path) {
    static INPUTS: OnceLock<BTreeMap<String, Vec<u8>>> = OnceLock::new();
    let inputs = INPUTS.get_or_init(|| {
        let place = tempfile::tempdir().expect("a temporary folder");
        make_once(place.path());
        contents(place.path())
    });
    for (name, bytes) in inputs {
        std::fs::write(folder.join(name), bytes).expect("a small file");
    }
}

fn make_once(folder: &Path) {
    make(folder, "a.mkv", &format!("{} -vf scale=160:90 -c:v ffv1 -pix_fmt yuv420p", shaky(0.4)));
    for name in ["p.png", "q.png"] {
        make(folder, name, "-f lavfi -i testsrc2=size=160x120 -frames:v 1");
    }
    let bar = Path::new(env!("CARGO_MANIFEST_DIR")).join("media/mesh-bar.ply");
    std::fs::copy(bar, folder.join("m.ply")).expect("a mesh of the project");
    let mut matrix = String::from("%%MatrixMarket matrix coordinate real symmetric\n400 400 799\n");
    for i in 1..=400 {
        writeln!(matrix, "{i} {i} 2.5").expect("text");
        if i > 1 {
            writeln!(matrix, "{i} {} -1", i - 1).expect("text");
        }
    }
    std::fs::write(folder.join("a.mtx"), matrix).expect("a small file");
}

/// All files below `folder` by their names, with their bytes; records of batches left out.
pub(crate) fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        // A run that still works removes its unfinished folders meanwhile.
        let entries = match std::fs::read_dir(&next) {
            Err(gone) if gone.kind() == ErrorKind::NotFound && next != folder => continue,
            entries => entries.expect("a folder"),
        };
        for entry in entries {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                // Records hold times; they have tests of their own.
                folders.extend(Some(path).filter(|path| !path.ends_with(".plumbline")));
            } else {
                let name = path.strip_prefix(folder).expect("inside").to_string_lossy().into_owned();
                found.insert(name, std::fs::read(&path).unwrap_or_default());
            }
        }
    }
    found
}

/// Cases of a test with random or numbered ones: `few`, or what `PLUMBLINE_CASES` says.
pub(crate) fn cases(few: usize) -> usize {
    std::env::var("PLUMBLINE_CASES").ok().and_then(|text| text.parse().ok()).unwrap_or(few)
}
