//! The history of a document: the list of documents, one for each step.
//!
//! A step *is* the document after it, so that undo is identical by construction. Steps in a row with the same key are one step until
//! the window seals it. The number of steps is bounded: the oldest goes, and what it shared with later ones stays.

use std::collections::VecDeque;

use crate::workspace::Step;

/// Maximum number of steps. A step costs what it does not share with its neighbors: a few bytes for an option, one list of
/// positions or weights for a drag or a stroke (0.5 MB at 20k vertices). More are beyond what a user goes back by hand.
const MAX_STEPS: usize = 500;

struct Entry<D> {
    label: String,
    merge: Option<String>,
    document: D,
}

/// Documents in the order of their steps; one of them is the present one.
pub struct History<D> {
    entries: VecDeque<Entry<D>>,
    at: usize,
    saved: Option<usize>,
    sealed: bool,
    max_steps: usize,
}

impl<D> History<D> {
    /// The history of a document that was just opened. Its files are on the disk unless `saved` is false.
    pub fn new(document: D, label: impl Into<String>, saved: bool) -> Self {
        let first = Entry { label: label.into(), merge: None, document };
        Self { entries: [first].into(), at: 0, saved: saved.then_some(0), sealed: true, max_steps: MAX_STEPS }
    }

    /// The same with another bound of the number of steps, at least 1.
    #[must_use]
    pub fn with_max_steps(self, max_steps: usize) -> Self {
        Self { max_steps: max_steps.max(1), ..self }
    }

    /// The present document.
    pub fn current(&self) -> &D {
        &self.entries[self.at].document
    }

    /// Adds a step after the present document; steps that were undone are dropped. A step with the key of the present one replaces
    /// it, unless that is sealed.
    pub fn push(&mut self, step: Step<D>) {
        self.truncate_after_present();
        let present = &self.entries[self.at];
        let merges = !self.sealed && step.merge.is_some() && step.merge == present.merge;
        let entry = Entry { label: step.label, merge: step.merge, document: step.document };
        if merges {
            self.entries[self.at] = entry;
            self.saved = self.saved.filter(|k| *k != self.at);
        } else {
            self.entries.push_back(entry);
            self.at += 1;
        }
        self.sealed = false;
        self.drop_oldest();
    }

    fn truncate_after_present(&mut self) {
        self.entries.truncate(self.at + 1);
        self.saved = self.saved.filter(|k| *k <= self.at);
    }

    fn drop_oldest(&mut self) {
        while self.entries.len() > self.max_steps {
            self.drop_first();
        }
    }

    fn drop_first(&mut self) {
        self.entries.pop_front();
        self.at -= 1;
        self.saved = self.saved.and_then(|k| k.checked_sub(1));
    }

    /// Ends the step: the next one with the same key is a step of its own.
    pub fn seal(&mut self) {
        self.sealed = true;
    }

    /// The document before the last step. False where there is none.
    pub fn undo(&mut self) -> bool {
        self.at.checked_sub(1).is_some_and(|k| self.go_to(k))
    }

    /// The document after the step that was undone. False where there is none.
    pub fn redo(&mut self) -> bool {
        self.go_to(self.at + 1)
    }

    /// The document after step `k`. False where there is no such step.
    pub fn go_to(&mut self, k: usize) -> bool {
        self.sealed = true;
        let exists = k < self.entries.len();
        if exists {
            self.at = k;
        }
        exists
    }

    /// The present document is on the disk.
    pub fn mark_saved(&mut self) {
        self.saved = Some(self.at);
        self.sealed = true;
    }

    /// What is on the disk is none of these documents.
    pub fn forget_saved(&mut self) {
        self.saved = None;
    }

    /// Whether the present document is on the disk.
    pub fn is_saved(&self) -> bool {
        self.saved == Some(self.at)
    }

    /// Drops the oldest steps whose documents `keeps` does not hold for; the present one stays.
    pub fn forget_before(&mut self, keeps: impl Fn(&D) -> bool) {
        while self.at > 0 && !keeps(&self.entries[0].document) {
            self.drop_first();
        }
    }

    /// Labels of the steps; the first is how the document was opened.
    pub fn labels(&self) -> impl Iterator<Item = &str> {
        self.entries.iter().map(|entry| entry.label.as_str())
    }

    /// Number of the present step.
    pub fn at(&self) -> usize {
        self.at
    }

    /// Number of the step that is on the disk.
    pub fn saved_at(&self) -> Option<usize> {
        self.saved
    }
}

#[cfg(test)]
#[path = "history_tests.rs"]
mod tests;
