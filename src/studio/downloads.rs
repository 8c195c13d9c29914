//! Files offered to windows: each by a link that can be used once.

use std::collections::VecDeque;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use crate::protocol::Download;
use crate::secret::Secret;

/// Time that a file waits to be fetched. The page fetches it at once.
const KEPT: Duration = Duration::from_mins(5);
/// Files that wait; the oldest goes.
const MAX_FILES: usize = 16;

#[derive(Debug)]
struct Offer {
    nonce: Secret,
    name: String,
    bytes: Vec<u8>,
    since: Instant,
}

/// Files that wait to be fetched.
#[derive(Debug, Default)]
pub struct Downloads {
    offers: Mutex<VecDeque<Offer>>,
}

impl Downloads {
    /// Offers a file.
    pub fn offer(&self, name: String, bytes: Vec<u8>) -> Download {
        let nonce = Secret::random();
        let url = format!("/download/{}", nonce.text());
        let mut offers = self.offers.lock().unwrap_or_else(PoisonError::into_inner);
        offers.push_back(Offer { nonce, name: name.clone(), bytes, since: Instant::now() });
        if offers.len() > MAX_FILES {
            offers.pop_front();
        }
        Download { url, name }
    }

    /// Name and content of the file that was offered under this text; afterwards it is offered no more.
    pub fn take(&self, nonce: &str) -> Option<(String, Vec<u8>)> {
        let mut offers = self.offers.lock().unwrap_or_else(PoisonError::into_inner);
        offers.retain(|offer| offer.since.elapsed() < KEPT);
        let k = offers.iter().position(|offer| offer.nonce.is(nonce))?;
        offers.remove(k).map(|offer| (offer.name, offer.bytes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_given_once_and_only_under_its_own_link() {
        let downloads = Downloads::default();
        let offered = downloads.offer("a.ply".into(), vec![1, 2]);
        let nonce = offered.url.strip_prefix("/download/").expect("a link").to_owned();
        assert_eq!(downloads.take("x"), None);
        assert_eq!(downloads.take(""), None);
        assert_eq!(downloads.take(&nonce), Some(("a.ply".into(), vec![1, 2])));
        assert_eq!(downloads.take(&nonce), None);
    }

    #[test]
    fn files_that_nobody_fetches_do_not_pile_up() {
        let downloads = Downloads::default();
        let first = downloads.offer("0".into(), Vec::new());
        (0..MAX_FILES).for_each(|k| drop(downloads.offer(k.to_string(), Vec::new())));
        assert_eq!(downloads.take(first.url.trim_start_matches("/download/")), None);
        assert_eq!(downloads.offers.lock().map(|o| o.len()).ok(), Some(MAX_FILES));
    }
}
