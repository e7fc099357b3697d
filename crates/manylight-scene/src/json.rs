//! Walking through a JSON document with messages that name the place.
//!
//! In: `serde_json::Value` · Out: checked numbers, texts and lists, or an [`Error`] whose place
//! is `file: path.inside[3].it`.

use glam::Vec3;
use serde_json::{Map, Value};

use crate::Error;

/// One value of a document and where it is.
#[derive(Clone, Debug)]
pub(crate) struct Item<'a> {
    /// The file, for messages.
    pub(crate) file: &'a str,
    /// Place inside the file, e.g. `camera.target`; empty at the root.
    pub(crate) path: String,
    /// What is there.
    pub(crate) value: &'a Value,
}

/// Parses a document; a leading byte order mark is allowed.
pub(crate) fn parse(file: &str, bytes: &[u8]) -> Result<Value, Error> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    serde_json::from_slice(bytes).map_err(|e| {
        let place = format!("{file}: line {}, column {}", e.line(), e.column());
        let text = e.to_string();
        let reason = text.split(" at line ").next().unwrap_or_default();
        Error::invalid(&place, format!("not valid JSON: {reason}; correct the file there"))
    })
}

impl<'a> Item<'a> {
    /// The root of a document.
    pub(crate) fn root(file: &'a str, value: &'a Value) -> Self {
        Self { file, path: String::new(), value }
    }

    /// An error at this place.
    pub(crate) fn fail(&self, problem: impl std::fmt::Display) -> Error {
        if self.path.is_empty() {
            Error::invalid(self.file, problem)
        } else {
            Error::invalid(&format!("{}: {}", self.file, self.path), problem)
        }
    }

    /// An error saying what stands here instead of what was wanted.
    pub(crate) fn fail_type(&self, wanted: &str) -> Error {
        self.fail(format!("{} found where {wanted} was expected", describe(self.value)))
    }

    /// The object here.
    pub(crate) fn map(&self) -> Result<&'a Map<String, Value>, Error> {
        self.value.as_object().ok_or_else(|| self.fail_type("an object {…}"))
    }

    /// A field of the object here; `null` counts as absent.
    pub(crate) fn field(&self, key: &str) -> Result<Option<Item<'a>>, Error> {
        Ok(match self.map()?.get(key) {
            None | Some(Value::Null) => None,
            Some(value) => {
                let path = match self.path.is_empty() {
                    true => key.to_owned(),
                    false => format!("{}.{key}", self.path),
                };
                Some(Item { file: self.file, path, value })
            }
        })
    }

    /// A field that must exist.
    pub(crate) fn required(&self, key: &str) -> Result<Item<'a>, Error> {
        self.field(key)?.ok_or_else(|| self.fail(format!("`{key}` is missing; add it")))
    }

    /// Refuses keys outside `allowed`.
    pub(crate) fn check_keys(&self, allowed: &[&str]) -> Result<(), Error> {
        for key in self.map()?.keys() {
            if !allowed.contains(&key.as_str()) {
                let path = match self.path.is_empty() {
                    true => key.clone(),
                    false => format!("{}.{key}", self.path),
                };
                let place = Item { file: self.file, path, value: self.value };
                return Err(place.fail(format!("unknown key; allowed: {}", allowed.join(", "))));
            }
        }
        Ok(())
    }

    /// The list here.
    pub(crate) fn list(&self) -> Result<&'a [Value], Error> {
        self.value.as_array().map(Vec::as_slice).ok_or_else(|| self.fail_type("a list […]"))
    }

    /// The list here, each entry with its place.
    pub(crate) fn items(&self) -> Result<Vec<Item<'a>>, Error> {
        let entry =
            |(i, value)| Item { file: self.file, path: format!("{}[{i}]", self.path), value };
        Ok(self.list()?.iter().enumerate().map(entry).collect())
    }

    /// The text here.
    pub(crate) fn text(&self) -> Result<&'a str, Error> {
        self.value.as_str().ok_or_else(|| self.fail_type("a text \"…\""))
    }

    /// The truth value here.
    pub(crate) fn flag(&self) -> Result<bool, Error> {
        self.value.as_bool().ok_or_else(|| self.fail_type("true or false"))
    }

    /// The finite number here.
    pub(crate) fn number(&self) -> Result<f64, Error> {
        self.value
            .as_f64()
            .filter(|x| x.is_finite())
            .ok_or_else(|| self.fail_type("a finite number"))
    }

    /// The number here, finite also in single precision.
    pub(crate) fn single(&self) -> Result<f32, Error> {
        let x = self.number()? as f32;
        match x.is_finite() {
            true => Ok(x),
            false => Err(self.fail(format!("{} is beyond single precision (±3.4e38)", self.value))),
        }
    }

    /// The whole number ≥ 0 here.
    pub(crate) fn whole(&self) -> Result<usize, Error> {
        let value = match self.value.as_f64() {
            Some(x) if x >= 0.0 && x.fract() == 0.0 && x <= 9.0e15 => Some(x as u64),
            _ => None,
        };
        value
            .and_then(|x| usize::try_from(x).ok())
            .ok_or_else(|| self.fail_type("a whole number of 0 or more"))
    }

    /// N finite numbers.
    pub(crate) fn singles<const N: usize>(&self) -> Result<[f32; N], Error> {
        let wanted = || format!("a list of {N} finite numbers");
        let list = self.value.as_array().ok_or_else(|| self.fail_type(&wanted()))?;
        if list.len() != N {
            let found = list.len();
            return Err(self.fail(format!("{found} values found where {} was expected", wanted())));
        }
        let mut out = [0.0; N];
        for (x, item) in out.iter_mut().zip(self.items()?) {
            *x = item.single()?;
        }
        Ok(out)
    }

    /// Three finite numbers.
    pub(crate) fn vec3(&self) -> Result<Vec3, Error> {
        self.singles::<3>().map(Vec3::from)
    }
}

/// A value in a few words.
fn describe(value: &Value) -> String {
    match value {
        Value::Null => "nothing (null)".to_owned(),
        Value::Bool(b) => format!("{b}"),
        Value::Number(x) => format!("the number {x}"),
        Value::String(s) => format!("the text \"{}\"", s.chars().take(40).collect::<String>()),
        Value::Array(_) => "a list".to_owned(),
        Value::Object(_) => "an object".to_owned(),
    }
}
