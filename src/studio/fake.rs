//! A tiny workspace for tests of session, server and page: a list of numbers. Not in the released program.

use std::sync::Arc;
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use crate::error::StudioError;
use crate::files::DocumentFiles;
use crate::outbox::Outbox;
use crate::workspace::{Answer, Step, Work, Workspace};
use plumbline_num::run::Run;

/// Kind of the buffer of numbers.
pub(crate) const NUMBERS: u32 = 1;

/// Numbers, and how long a slice of work takes.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
pub(crate) struct Numbers {
    pub(crate) numbers: Arc<Vec<f64>>,
    #[serde(default)]
    pub(crate) slice_ms: u64,
}

#[derive(Debug, Deserialize)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
pub(crate) enum Edit {
    /// One number; drags of it are one step.
    Set { at: usize, to: f64 },
    /// Appends a number.
    Append { number: f64 },
    /// How long a slice takes.
    Slow { ms: u64 },
    /// Panics.
    Panic,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct View {
    /// Multiplies the numbers that are shown.
    scale: Option<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(tag = "ask", rename_all = "snake_case", deny_unknown_fields)]
pub(crate) enum Ask {
    /// The sum.
    Sum,
    /// The numbers as a text file.
    Export,
    /// Panics.
    Panic,
}

#[derive(Debug, Serialize)]
pub(crate) struct State {
    sum: f64,
    count: usize,
    /// Slices that came to their end, and those that were stopped.
    slices: usize,
    stopped: usize,
}

#[derive(Debug)]
pub(crate) struct Fake {
    scale: f64,
    slices: usize,
    stopped: usize,
    /// Slices until rest.
    left: usize,
}

impl Workspace for Fake {
    type Document = Numbers;
    type Edit = Edit;
    type View = View;
    type Ask = Ask;
    type State = State;
    const NAME: &'static str = "fake";

    fn open(files: &mut DocumentFiles, _run: &Run) -> Result<(Self, Numbers), StudioError> {
        let fail = |why: String| StudioError::Input { path: files.opened().to_owned(), why };
        let text = files.read(files.opened(), 1 << 20)?.ok_or_else(|| fail("there is no such file".into()))?;
        let document = serde_json::from_slice(&text).map_err(|e| fail(e.to_string()))?;
        Ok((Self { scale: 1.0, slices: 0, stopped: 0, left: 0 }, document))
    }

    fn edit(&mut self, document: &Numbers, edit: Edit) -> Result<Step<Numbers>, StudioError> {
        let mut next = document.clone();
        let numbers = Arc::make_mut(&mut next.numbers);
        match edit {
            Edit::Set { at, to } => {
                let count = numbers.len();
                let outside = || StudioError::request(format!("there is no number {at} (expected 0 to {count})"));
                *numbers.get_mut(at).ok_or_else(outside)? = to;
                Ok(Step::new(next, format!("Set number {at}")).merged(format!("set {at}")))
            }
            Edit::Append { number } => {
                numbers.push(number);
                Ok(Step::new(next, "Append"))
            }
            Edit::Slow { ms } => Ok(Step::new(Numbers { slice_ms: ms.min(5000), ..document.clone() }, "Slow")),
            Edit::Panic => panic!("asked to"),
        }
    }

    fn view(&mut self, _: &Numbers, view: View) -> Result<(), StudioError> {
        self.scale = view.scale.unwrap_or(self.scale);
        self.left = 1;
        Ok(())
    }

    fn changed(&mut self, _: &Numbers) {
        self.left = 2;
    }

    fn state(&self, document: &Numbers) -> State {
        let numbers = &document.numbers;
        State { sum: numbers.iter().sum(), count: numbers.len(), slices: self.slices, stopped: self.stopped }
    }

    fn greet(&mut self, document: &Numbers, out: &mut Outbox) {
        let shown: Vec<f64> = document.numbers.iter().map(|x| x * self.scale).collect();
        out.buffer(NUMBERS, 0, &shown);
    }

    fn work(&mut self, document: &Numbers, out: &mut Outbox, run: &Run) -> Result<Work, StudioError> {
        let until = Instant::now() + Duration::from_millis(document.slice_ms);
        while Instant::now() < until {
            if let Err(stopped) = run.check() {
                self.stopped += 1;
                return Err(stopped.into());
            }
            std::thread::park_timeout(Duration::from_millis(1));
        }
        self.slices += 1;
        self.left = self.left.saturating_sub(1);
        self.greet(document, out);
        if document.numbers.iter().sum::<f64>() < 0.0 && self.left == 0 {
            out.notice("the sum is negative");
        }
        Ok(if self.left > 0 { Work::More } else { Work::Rest })
    }

    fn save(&self, document: &Numbers, files: &mut DocumentFiles) -> Result<(), StudioError> {
        let text = serde_json::to_vec(document).map_err(|e| StudioError::Method(e.to_string()))?;
        let path = files.opened().to_owned();
        files.write(path, text);
        Ok(())
    }

    fn ask(&mut self, document: &Numbers, ask: Ask, _: &DocumentFiles, _: &Run) -> Result<Answer, StudioError> {
        match ask {
            Ask::Sum => Ok(Answer::Value(document.numbers.iter().sum::<f64>().into())),
            Ask::Export => {
                Ok(Answer::Download { name: "numbers.txt".into(), bytes: format!("{:?}", document.numbers).into() })
            }
            Ask::Panic => panic!("asked to"),
        }
    }
}
