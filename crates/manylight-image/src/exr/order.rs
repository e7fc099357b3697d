//! Attributes of a header in the order of their names, so that equal pictures are equal files.
//!
//! In: what an encoder writes, its attributes in any order · Out: the same bytes, sorted.
//! Limits: files of one part; headers of at most 1 MiB, longer ones keep their order.

use std::io::{self, Seek, SeekFrom, Write};

/// Bytes before the attributes: magic number, version and flags.
const PREFIX_LEN: usize = 8;
/// Most bytes kept to be sorted.
const MAX_HEADER_LEN: usize = 1 << 20;

/// Passes everything on and remembers how the file begins.
pub(super) struct Remember<W> {
    sink: W,
    start: Vec<u8>,
    /// Whether all that came so far came in order.
    is_start: bool,
}

impl<W: Write + Seek> Remember<W> {
    pub(super) fn new(sink: W) -> Self {
        Self { sink, start: Vec::new(), is_start: true }
    }

    /// Writes the attributes again, sorted; to be called once the file is complete.
    pub(super) fn sort_attributes(mut self) -> io::Result<()> {
        if let Some(sorted) = sorted(&self.start) {
            self.sink.seek(SeekFrom::Start(PREFIX_LEN as u64))?;
            self.sink.write_all(&sorted)?;
        }
        self.sink.flush()
    }
}

impl<W: Write> Write for Remember<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.sink.write(bytes)?;
        if self.is_start {
            self.start.extend_from_slice(&bytes[..count]);
            self.is_start = self.start.len() < MAX_HEADER_LEN;
        }
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.sink.flush()
    }
}

impl<W: Seek> Seek for Remember<W> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.is_start = false;
        self.sink.seek(to)
    }
}

/// The attributes at the start of a file, sorted; `None` where they do not end.
fn sorted(start: &[u8]) -> Option<Vec<u8>> {
    let mut attributes = Vec::new();
    let mut rest = start.get(PREFIX_LEN..)?;
    while *rest.first()? != 0 {
        let name_len = rest.iter().position(|&byte| byte == 0)?;
        let type_len = rest[name_len + 1..].iter().position(|&byte| byte == 0)?;
        let size_at = name_len + type_len + 2;
        let size = rest.get(size_at..size_at + 4)?.try_into().ok()?;
        let end = (size_at + 4).checked_add(u32::from_le_bytes(size) as usize)?;
        attributes.push((&rest[..name_len], rest.get(..end)?));
        rest = &rest[end..];
    }
    attributes.sort();
    Some(attributes.iter().flat_map(|(_, attribute)| *attribute).copied().collect())
}
