//! Letters to a document, and the interrupt of the slice of work that they arrive in.
//!
//! A letter stops the running slice. But an edit waits until the slice had the time of a picture (the *patience*): edits that come
//! faster than pictures are made would else leave no slice to its end, and nothing would be drawn during a drag.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use plumbline_num::run::{Interrupt, Run};

use super::window::{Window, WindowId};
use crate::protocol::Command;

/// Letters that may wait. A page waits for replies long before; one that does not is answered by an error.
const MAX_LETTERS: usize = 1024;

/// A letter to a document.
#[derive(Debug)]
pub enum Letter {
    /// A window was opened.
    Attach(Arc<Window>),
    /// A window is gone.
    Detach(WindowId),
    /// A window wants something.
    Command(Request),
}

/// What a window wants.
#[derive(Debug)]
pub struct Request {
    /// The window.
    pub window: WindowId,
    /// Number of the message.
    pub id: Option<u32>,
    /// What it wants.
    pub command: Command,
}

impl Letter {
    fn is_edit(&self) -> bool {
        matches!(self, Self::Command(Request { command: Command::Edit { .. }, .. }))
    }

    /// The window of a drag.
    fn dragging(&self) -> Option<WindowId> {
        match self {
            Self::Command(Request { window, command: Command::Edit { newest: true, .. }, .. }) => Some(*window),
            _ => None,
        }
    }

    fn window(&self) -> Option<WindowId> {
        match self {
            Self::Command(request) => Some(request.window),
            Self::Attach(_) | Self::Detach(_) => None,
        }
    }
}

/// What became of a letter.
#[derive(Debug, PartialEq, Eq)]
pub enum Posted {
    /// It waits.
    Waits,
    /// It waits in the position of an earlier drag with this number.
    Replaced(Option<u32>),
    /// Too many wait, or the document is closed.
    Refused,
}

#[derive(Debug, Default)]
struct State {
    letters: VecDeque<Letter>,
    /// Until when an edit does not stop the running slice; `None` between slices.
    patient_until: Option<Instant>,
    /// When the running slice is stopped.
    stop_at: Option<Instant>,
    closed: bool,
}

/// Letters to a document.
#[derive(Debug, Default)]
pub struct Mailbox {
    state: Mutex<State>,
    arrived: Condvar,
    paced: Condvar,
    slice: Arc<AtomicBool>,
    end: Arc<AtomicBool>,
}

impl Mailbox {
    fn state(&self) -> MutexGuard<'_, State> {
        // Nothing in here panics while it holds the lock.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts a letter into the box.
    pub fn post(&self, letter: Letter) -> Posted {
        let mut state = self.state();
        let full = letter.window().is_some() && state.letters.len() >= MAX_LETTERS;
        if state.closed || full {
            return Posted::Refused;
        }
        let posted = replace_drag(&mut state.letters, &letter);
        self.interrupt_for(&mut state, &letter);
        state.letters.push_back(letter);
        drop(state);
        self.arrived.notify_one();
        posted
    }

    fn interrupt_for(&self, state: &mut State, letter: &Letter) {
        let Some(patient_until) = state.patient_until else { return };
        if letter.is_edit() && Instant::now() < patient_until {
            state.stop_at = Some(state.stop_at.map_or(patient_until, |at| at.min(patient_until)));
            self.paced.notify_one();
        } else {
            self.slice.store(true, Ordering::Relaxed);
        }
    }

    /// The next letter; waits for one until `deadline`. `None` where none came, or the box is closed.
    pub fn take(&self, deadline: Option<Instant>) -> Option<Letter> {
        let mut state = self.state();
        loop {
            if state.closed {
                return None;
            }
            if let Some(letter) = state.letters.pop_front() {
                return Some(letter);
            }
            let left = deadline.map(|at| at.saturating_duration_since(Instant::now()));
            state = match left {
                Some(Duration::ZERO) => return None,
                Some(left) => self.arrived.wait_timeout(state, left).unwrap_or_else(PoisonError::into_inner).0,
                None => self.arrived.wait(state).unwrap_or_else(PoisonError::into_inner),
            };
        }
    }

    /// Letters that wait.
    pub fn waiting(&self) -> usize {
        self.state().letters.len()
    }

    /// How a slice of work runs that starts now; `None` where a letter waits. Edits do not stop it for `patience`; at `latest` it
    /// is stopped in any case.
    pub fn start_slice(&self, patience: Duration, latest: Option<Instant>) -> Option<Run> {
        let mut state = self.state();
        if state.closed || !state.letters.is_empty() {
            return None;
        }
        self.slice.store(false, Ordering::Relaxed);
        state.patient_until = Some(Instant::now() + patience);
        state.stop_at = latest;
        self.paced.notify_one();
        Some(Run::with_interrupt(&Interrupt::from_flag(Arc::clone(&self.slice))))
    }

    /// The slice is over. True where it was told to stop.
    pub fn end_slice(&self) -> bool {
        let mut state = self.state();
        state.patient_until = None;
        state.stop_at = None;
        self.slice.swap(false, Ordering::Relaxed)
    }

    /// How a call runs that only the end of the document stops.
    pub fn whole_run(&self) -> Run {
        Run::with_interrupt(&Interrupt::from_flag(Arc::clone(&self.end)))
    }

    /// Refuses letters from now on, and stops what runs.
    pub fn close(&self) {
        self.state().closed = true;
        self.end.store(true, Ordering::Relaxed);
        self.slice.store(true, Ordering::Relaxed);
        self.arrived.notify_one();
        self.paced.notify_one();
    }

    /// Letters that wait in a closed box.
    pub fn left(&self) -> Vec<Letter> {
        self.state().letters.drain(..).collect()
    }

    /// Whether it was closed.
    pub fn is_closed(&self) -> bool {
        self.state().closed
    }

    /// Stops slices whose time has come, until the box is closed: the work of a thread of its own.
    pub fn pace(&self) {
        let mut state = self.state();
        while !state.closed {
            let left = state.stop_at.map(|at| at.saturating_duration_since(Instant::now()));
            state = match left {
                Some(Duration::ZERO) => {
                    self.slice.store(true, Ordering::Relaxed);
                    state.stop_at = None;
                    state
                }
                Some(left) => self.paced.wait_timeout(state, left).unwrap_or_else(PoisonError::into_inner).0,
                None => self.paced.wait(state).unwrap_or_else(PoisonError::into_inner),
            };
        }
    }
}

/// Takes out the drag that waits where `letter` is a drag too and the window wanted nothing else meanwhile.
fn replace_drag(letters: &mut VecDeque<Letter>, letter: &Letter) -> Posted {
    let window = letter.dragging();
    let last = window.and_then(|_| letters.iter().rposition(|waiting| waiting.window() == window));
    match last.filter(|k| letters[*k].dragging().is_some()).and_then(|k| letters.remove(k)) {
        Some(Letter::Command(request)) => Posted::Replaced(request.id),
        _ => Posted::Waits,
    }
}

#[cfg(test)]
#[path = "mailbox_tests.rs"]
mod tests;
