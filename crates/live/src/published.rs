//! The session's last state and picture, for the threads that answer requests.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crate::arrival::Arrival;
use crate::page_state::PageState;
use crate::picture::png_of;

#[derive(Debug, Default)]
struct Latest {
    version: u64,
    state: PageState,
    frame: Option<Arc<Arrival>>,
    /// The picture with its number: encoded once, however many look at it, and not at all while nobody does.
    encoded: Option<(u64, Arc<Vec<u8>>)>,
}

/// The session's last state and picture. Nobody waits for a slow reader: what was published before is forgotten.
#[derive(Debug, Default)]
pub struct Published {
    latest: Mutex<Latest>,
    changed: Condvar,
}

impl Published {
    fn lock(&self) -> MutexGuard<'_, Latest> {
        self.latest.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Publishes a state, with the frame that its picture shows.
    pub fn publish(&self, state: PageState, frame: Option<Arc<Arrival>>) {
        let mut latest = self.lock();
        latest.version += 1;
        (latest.state, latest.frame) = (state, frame);
        self.changed.notify_all();
    }

    /// Waits for a state after a version, at most for some time, and returns the last one as JSON, with its version.
    pub(crate) fn state_after(&self, version: u64, time: Duration) -> String {
        let wait = self.changed.wait_timeout_while(self.lock(), time, |latest| latest.version == version);
        let latest = wait.unwrap_or_else(PoisonError::into_inner).0;
        let (version, state) = (latest.version, latest.state.clone());
        drop(latest);
        let mut value = serde_json::to_value(&state).unwrap_or_default();
        value["version"] = version.into();
        value.to_string()
    }

    /// The last picture as PNG; `None` before the first frame.
    pub(crate) fn picture(&self) -> Option<Arc<Vec<u8>>> {
        let latest = self.lock();
        let number = latest.state.picture;
        if let Some((encoded, bytes)) = &latest.encoded
            && *encoded == number
        {
            return Some(bytes.clone());
        }
        let frame = latest.frame.clone()?;
        drop(latest);
        let bytes = Arc::new(png_of(&frame.image)?);
        self.lock().encoded = Some((number, bytes.clone()));
        Some(bytes)
    }
}
