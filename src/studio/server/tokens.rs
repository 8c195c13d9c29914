//! Tokens: one-time ones in links, exchanged for session tokens that a page keeps.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::secret::Secret;

/// Tokens of each kind that are valid at the same time; the oldest ends. More than windows that anybody opens.
const MAX_TOKENS: usize = 256;

#[derive(Debug, Default)]
struct Valid {
    once: VecDeque<Secret>,
    sessions: VecDeque<Secret>,
}

/// Tokens that are valid.
#[derive(Debug, Default)]
pub(crate) struct Tokens(Mutex<Valid>);

impl Tokens {
    fn valid(&self) -> MutexGuard<'_, Valid> {
        // Nothing in here panics while it holds the lock.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A token that can be exchanged once.
    pub(crate) fn invite(&self) -> Secret {
        add(&mut self.valid().once)
    }

    /// The session token for a one-time token, which ends. `None` for any other text.
    pub(crate) fn exchange(&self, once: &str) -> Option<Secret> {
        let mut valid = self.valid();
        let k = valid.once.iter().position(|secret| secret.is(once))?;
        valid.once.remove(k);
        Some(add(&mut valid.sessions))
    }

    /// Whether a text is a session token.
    pub(crate) fn is_session(&self, text: &str) -> bool {
        self.valid().sessions.iter().any(|secret| secret.is(text))
    }
}

fn add(list: &mut VecDeque<Secret>) -> Secret {
    let secret = Secret::random();
    list.push_back(secret.clone());
    if list.len() > MAX_TOKENS {
        list.pop_front();
    }
    secret
}
