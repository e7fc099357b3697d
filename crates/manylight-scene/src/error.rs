//! What can be wrong with a scene file, in sentences for its author.

/// Longest place or problem kept in a message, characters; names in files have no limit.
const MAX_TEXT_CHARS: usize = 600;

/// Why a scene could not be used. The text names the thing, the value, what was allowed and
/// what to do next.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file could not be read.
    #[error("cannot read {path}: {reason}")]
    Read {
        /// The file.
        path: String,
        /// The system's or decoder's words.
        reason: String,
    },
    /// A file was read but its content cannot be used.
    #[error("{place}: {problem}")]
    Invalid {
        /// File and position inside it, e.g. `shot.json: camera.vfov_deg`.
        place: String,
        /// What is wrong, what was allowed, what to do.
        problem: String,
    },
}

impl Error {
    /// [`Error::Read`] on one line, whatever the parts contain.
    pub(crate) fn read(path: &str, reason: impl std::fmt::Display) -> Self {
        Self::Read { path: one_line(path), reason: one_line(&reason.to_string()) }
    }

    /// [`Error::Invalid`] on one line, whatever the parts contain.
    pub(crate) fn invalid(place: &str, problem: impl std::fmt::Display) -> Self {
        Self::Invalid { place: one_line(place), problem: one_line(&problem.to_string()) }
    }
}

/// Text without control characters, cut to a readable length.
pub(crate) fn one_line(text: &str) -> String {
    let mut out: String = text
        .chars()
        .take(MAX_TEXT_CHARS)
        .map(|c| if c.is_control() || c == '\u{2028}' || c == '\u{2029}' { ' ' } else { c })
        .collect();
    if text.chars().nth(MAX_TEXT_CHARS).is_some() {
        out.push('…');
    }
    out
}

/// Something in a scene that was repaired or left out, with how often it occurred.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// One sentence without the count.
    pub message: String,
    /// How often.
    pub count: u64,
}

impl std::fmt::Display for Warning {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} ({}×)", self.message, self.count)
    }
}

/// Warnings in order of first occurrence, equal messages counted together.
#[derive(Debug, Default)]
pub(crate) struct Warnings(pub(crate) Vec<Warning>);

/// Different messages kept; the rest is counted under one.
const MAX_WARNINGS: usize = 64;

impl Warnings {
    /// The first one that is meant.
    pub(crate) fn find(&self, is_meant: impl Fn(&str) -> bool) -> Option<&Warning> {
        self.0.iter().find(|w| is_meant(&w.message))
    }

    /// Counts `count` more occurrences of `message`; nothing for zero.
    pub(crate) fn add(&mut self, message: &str, count: u64) {
        if count == 0 {
            return;
        }
        let message = one_line(message);
        if let Some(known) = self.0.iter_mut().find(|w| w.message == message) {
            known.count = known.count.saturating_add(count);
        } else if self.0.len() < MAX_WARNINGS {
            self.0.push(Warning { message, count });
        } else if let Some(last) = self.0.last_mut() {
            // Too many different messages: keep counting under the last place.
            let known = if last.message == "further oddities" { last.count } else { 1 };
            *last = Warning {
                message: "further oddities".to_owned(),
                count: known.saturating_add(count),
            };
        }
    }
}
