//! Bytes of a glTF file: buffers, views, accessors.
//!
//! In: JSON and files · Out: [`Accessor`], random access to checked elements.
//! Limits: every count is compared with the bytes that exist before anything is allocated.

use std::collections::HashMap;
use std::ffi::OsString;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde_json::Value;

use super::{Budget, Document};
use crate::Error;
use crate::json::Item;

/// Largest accessor without bytes of its own (zeros, with sparse values on top), elements.
const MAX_IMPLICIT_ELEMENTS: usize = 1 << 24;

/// Largest file read, bytes.
pub(crate) const MAX_FILE_BYTES: u64 = 1 << 33;

/// Bytes that live in the file or were read from elsewhere.
#[derive(Clone, Debug)]
pub(crate) enum Bytes<'a> {
    /// A part of the file's own bytes.
    Own(&'a [u8]),
    /// Decoded or read, shared by all that name them.
    Shared(Arc<Vec<u8>>),
}

impl std::ops::Deref for Bytes<'_> {
    type Target = [u8];
    fn deref(&self) -> &[u8] {
        match self {
            Bytes::Own(bytes) => bytes,
            Bytes::Shared(bytes) => bytes,
        }
    }
}

/// Turns URIs into bytes, each once.
#[derive(Debug)]
pub(crate) struct Resolver<'a> {
    /// Folder of the glTF file; `None` where only bytes were given.
    pub(crate) folder: Option<&'a Path>,
    /// What was read already, by `data:` URI or path.
    known: HashMap<OsString, Arc<Vec<u8>>>,
    /// Bytes read so far.
    pub(crate) byte_count: u64,
}

impl<'a> Resolver<'a> {
    /// A resolver for files beside the glTF file.
    pub(crate) fn new(folder: Option<&'a Path>) -> Self {
        Self { folder, known: HashMap::new(), byte_count: 0 }
    }

    /// The bytes behind a URI: `data:` or a relative file.
    pub(crate) fn resolve(&mut self, uri: &Item<'_>) -> Result<Arc<Vec<u8>>, Error> {
        let text = uri.text()?;
        let encoded = text.strip_prefix("data:");
        let key = match encoded {
            Some(_) => OsString::from(text),
            None => {
                let path = self.find_relative(uri, text)?;
                // One file under many names is one file.
                path.canonicalize().unwrap_or(path).into_os_string()
            }
        };
        if let Some(bytes) = self.known.get(&key) {
            return Ok(bytes.clone());
        }
        let bytes = match encoded {
            Some(rest) => decode_data_uri(rest).ok_or_else(|| {
                uri.fail("data: URI that is not base64; allowed: data:<type>;base64,<characters>")
            })?,
            None => read_file(Path::new(&key)).map_err(|e| {
                let reason = match e {
                    Error::Read { reason, .. } | Error::Invalid { problem: reason, .. } => reason,
                };
                let shown: String = text.chars().take(80).collect();
                uri.fail(format!("cannot read \"{shown}\": {reason}"))
            })?,
        };
        self.byte_count += bytes.len() as u64;
        let bytes = Arc::new(bytes);
        self.known.insert(key, bytes.clone());
        Ok(bytes)
    }

    fn find_relative(&self, uri: &Item<'_>, text: &str) -> Result<PathBuf, Error> {
        let shown: String = text.chars().take(80).collect();
        let path = percent_decode(text);
        let path = Path::new(&path);
        if text.contains("://") || path.is_absolute() || text.starts_with("file:") {
            return Err(uri.fail(format!(
                "\"{shown}\" is not a relative file; put the file beside the glTF file"
            )));
        }
        let folder = self.folder.ok_or_else(|| {
            uri.fail(format!(
                "external file \"{shown}\" cannot be reached from bytes alone; embed it (.glb)"
            ))
        })?;
        Ok(folder.join(path))
    }
}

/// The files that buffers and images name, whether they are used or not.
pub(crate) fn list_files(root: &Value, folder: &Path) -> Vec<PathBuf> {
    let lists = ["buffers", "images"].into_iter().filter_map(|key| root.get(key)?.as_array());
    let uris = lists.flatten().filter_map(|entry| entry.get("uri")?.as_str());
    let files = uris.filter(|uri| !uri.starts_with("data:"));
    files.map(|uri| folder.join(percent_decode(uri))).collect()
}

/// The bytes of a regular file of reasonable size.
pub(crate) fn read_file(path: &Path) -> Result<Vec<u8>, Error> {
    let name = path.display().to_string();
    if name.is_empty() {
        return Err(Error::read("\"\"", "the name is empty; give the path of a file"));
    }
    let unreadable =
        |e: std::io::Error| Error::read(&name, format!("{e}; check the path and its permissions"));
    let meta = std::fs::metadata(path).map_err(unreadable)?;
    if !meta.is_file() {
        return Err(Error::read(&name, "not a file; give the path of a file"));
    }
    if meta.len() > MAX_FILE_BYTES {
        let reason = format!("{} bytes; at most {MAX_FILE_BYTES} are read", meta.len());
        return Err(Error::read(&name, reason));
    }
    // No more than there is: files of the system that claim to be empty may wait for ever.
    let mut bytes = Vec::new();
    if meta.len() > 0 {
        let file = std::fs::File::open(path).map_err(unreadable)?;
        file.take(meta.len()).read_to_end(&mut bytes).map_err(unreadable)?;
    }
    Ok(bytes)
}

/// `<type>;base64,<characters>` → bytes.
fn decode_data_uri(rest: &str) -> Option<Vec<u8>> {
    let (head, body) = rest.split_once(',')?;
    if !head.ends_with(";base64") {
        return None;
    }
    decode_base64(body.as_bytes())
}

/// Standard or URL-safe alphabet, padding optional.
fn decode_base64(text: &[u8]) -> Option<Vec<u8>> {
    let end = text.iter().rposition(|&c| c != b'=').map_or(0, |i| i + 1);
    let mut out = Vec::with_capacity(end / 4 * 3 + 3);
    let (mut bits, mut bit_count) = (0_u32, 0);
    for &c in &text[..end] {
        let value = match c {
            b'A'..=b'Z' => c - b'A',
            b'a'..=b'z' => c - b'a' + 26,
            b'0'..=b'9' => c - b'0' + 52,
            b'+' | b'-' => 62,
            b'/' | b'_' => 63,
            _ => return None,
        };
        bits = (bits << 6) | u32::from(value);
        bit_count += 6;
        if bit_count >= 8 {
            bit_count -= 8;
            out.push((bits >> bit_count) as u8);
        }
    }
    (end % 4 != 1).then_some(out)
}

/// `%20` → space; invalid sequences stay as they are.
fn percent_decode(text: &str) -> String {
    let bytes = text.as_bytes();
    let mut out = Vec::with_capacity(bytes.len());
    let mut i = 0;
    while i < bytes.len() {
        let digits = bytes.get(i + 1..i + 3).and_then(|d| std::str::from_utf8(d).ok());
        match digits.and_then(|d| u8::from_str_radix(d, 16).ok()) {
            Some(byte) if bytes[i] == b'%' => {
                out.push(byte);
                i += 3;
            }
            _ => {
                out.push(bytes[i]);
                i += 1;
            }
        }
    }
    String::from_utf8(out).unwrap_or_else(|_| text.to_owned())
}

/// All buffers of the file, each as long as it says.
pub(crate) fn load_buffers<'a>(
    root: &Item<'_>,
    bin: Option<&'a [u8]>,
    resolver: &mut Resolver<'_>,
) -> Result<Vec<Bytes<'a>>, Error> {
    let mut buffers = Vec::new();
    let Some(list) = root.field("buffers")? else { return Ok(buffers) };
    for (i, item) in list.items()?.into_iter().enumerate() {
        let declared = item.required("byteLength")?;
        let byte_length = declared.whole()?;
        let bytes = match (item.field("uri")?, bin) {
            (Some(uri), _) => Bytes::Shared(resolver.resolve(&uri)?),
            (None, Some(bin)) if i == 0 => Bytes::Own(bin),
            _ => {
                return Err(item.fail("has neither a `uri` nor a binary chunk; re-export the file"));
            }
        };
        if bytes.len() < byte_length {
            return Err(declared.fail(format!(
                "{byte_length} bytes declared but only {} exist; the file is cut short or damaged",
                bytes.len()
            )));
        }
        buffers.push(bytes);
    }
    Ok(buffers)
}

/// Number format of an accessor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn from_code(code: usize) -> Option<Self> {
        Some(match code {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return None,
        })
    }

    fn byte_size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// The number at the start of `b`, which holds at least [`Self::byte_size`] bytes.
    fn decode(self, b: &[u8], normalized: bool) -> f32 {
        let scale = |x: f32, max: f32| if normalized { (x / max).max(-1.0) } else { x };
        match self {
            Self::I8 => scale(f32::from(b[0] as i8), 127.0),
            Self::U8 => scale(f32::from(b[0]), 255.0),
            Self::I16 => scale(f32::from(i16::from_le_bytes([b[0], b[1]])), 32767.0),
            Self::U16 => scale(f32::from(u16::from_le_bytes([b[0], b[1]])), 65535.0),
            Self::U32 => scale(u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as f32, 4294967295.0),
            Self::F32 => f32::from_le_bytes([b[0], b[1], b[2], b[3]]),
        }
    }
}

/// Typed elements of a buffer; all offsets were checked when it was made.
#[derive(Debug)]
pub(crate) struct Accessor<'a> {
    /// Number of elements.
    pub(crate) count: usize,
    /// Numbers per element.
    pub(crate) width: usize,
    /// Number format.
    pub(crate) component: Component,
    normalized: bool,
    /// Bytes from the first element on, and from one element to the next.
    base: Option<(&'a [u8], usize)>,
    /// Replaced elements: ascending indices and packed values.
    sparse: Option<(Vec<u32>, &'a [u8])>,
}

impl<'a> Accessor<'a> {
    /// Accessor that `reference` (an index into `accessors`) names; its type must be in `types`.
    pub(crate) fn new(
        doc: &'a Document<'_>,
        reference: &Item<'_>,
        types: &[&str],
        budget: &mut Budget,
    ) -> Result<Self, Error> {
        let (_, item) = doc.follow(reference, "accessors")?;
        let within = |e: Error| match e {
            Error::Invalid { place, problem } => {
                Error::invalid(&place, format!("{problem} (used by {})", reference.path))
            }
            other => other,
        };
        Self::parse(doc, &item, types, budget).map_err(within)
    }

    fn parse(
        doc: &'a Document<'_>,
        item: &Item<'_>,
        types: &[&str],
        budget: &mut Budget,
    ) -> Result<Self, Error> {
        let code = item.required("componentType")?;
        let component = Component::from_code(code.whole()?).ok_or_else(|| {
            code.fail("unknown number format; allowed: 5120, 5121, 5122, 5123, 5125, 5126")
        })?;
        let kind = item.required("type")?;
        let width = match kind.text()? {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" | "MAT2" => 4,
            "MAT3" => 9,
            "MAT4" => 16,
            other => return Err(kind.fail(format!("unknown type \"{other}\""))),
        };
        if !types.contains(&kind.text()?) {
            let found = kind.text()?;
            return Err(kind.fail(format!("{found} found; allowed here: {}", types.join(", "))));
        }
        let count_item = item.required("count")?;
        let count = count_item.whole()?;
        let normalized = item.field("normalized")?.map_or(Ok(false), |f| f.flag())?;
        let element = width * component.byte_size();
        let offset = item.field("byteOffset")?.map_or(Ok(0), |o| o.whole())?;
        let base = match item.field("bufferView")? {
            Some(view) => {
                let (bytes, stride) = view_bytes(doc, &view)?;
                let stride = stride.unwrap_or(element);
                if stride < element {
                    return Err(view.fail(format!(
                        "byteStride {stride} is smaller than one element of {element} bytes"
                    )));
                }
                let bytes = slice_elements(&count_item, bytes, offset, count, stride, element)?;
                Some((bytes, stride))
            }
            None if count > MAX_IMPLICIT_ELEMENTS => {
                return Err(count_item.fail(format!(
                    "{count} elements without a bufferView; at most {MAX_IMPLICIT_ELEMENTS} allowed"
                )));
            }
            None => None,
        };
        let sparse = match item.field("sparse")? {
            Some(sparse) => Some(parse_sparse(doc, &sparse, count, element, budget)?),
            None => None,
        };
        Ok(Self { count, width, component, normalized, base, sparse })
    }

    /// Bytes of element `i` < count; `None`: zeros.
    fn element(&self, i: usize) -> Option<&'a [u8]> {
        if let Some((indices, values)) = &self.sparse
            && let Ok(k) = indices.binary_search(&(i as u32))
        {
            return values.get(k * self.width * self.component.byte_size()..);
        }
        let (bytes, stride) = self.base?;
        bytes.get(i * stride..)
    }

    /// Element `i` as numbers, 0 for components the accessor lacks.
    pub(crate) fn read<const N: usize>(&self, i: usize) -> [f32; N] {
        let mut out = [0.0; N];
        let Some(bytes) = self.element(i) else { return out };
        let size = self.component.byte_size();
        for (x, b) in out.iter_mut().zip(bytes.chunks_exact(size)).take(self.width) {
            *x = self.component.decode(b, self.normalized);
        }
        out
    }

    /// Element `i` as an index (unsigned formats).
    pub(crate) fn read_index(&self, i: usize) -> u32 {
        match (self.element(i), self.component) {
            (Some([a, ..]), Component::U8) => u32::from(*a),
            (Some([a, b, ..]), Component::U16) => u32::from(u16::from_le_bytes([*a, *b])),
            (Some([a, b, c, d, ..]), Component::U32) => u32::from_le_bytes([*a, *b, *c, *d]),
            _ => 0,
        }
    }

    /// Whether [`Self::read_index`] makes sense.
    pub(crate) fn is_unsigned(&self) -> bool {
        matches!(self.component, Component::U8 | Component::U16 | Component::U32)
    }
}

/// The bytes of a view and its stride, if stated.
pub(crate) fn view_bytes<'a>(
    doc: &'a Document<'_>,
    reference: &Item<'_>,
) -> Result<(&'a [u8], Option<usize>), Error> {
    let (_, view) = doc.follow(reference, "bufferViews")?;
    let buffer_item = view.required("buffer")?;
    let index = buffer_item.whole()?;
    let buffer = doc.buffers.get(index).ok_or_else(|| {
        buffer_item.fail(format!("buffer {index} does not exist; there are {}", doc.buffers.len()))
    })?;
    let offset = view.field("byteOffset")?.map_or(Ok(0), |o| o.whole())?;
    let length = view.required("byteLength")?.whole()?;
    let bytes = offset.checked_add(length).and_then(|end| buffer.get(offset..end));
    let bytes = bytes.ok_or_else(|| {
        view.fail(format!(
            "bytes {offset} + {length} reach beyond the {} bytes of buffer {index}",
            buffer.len()
        ))
    })?;
    let stride = view.field("byteStride")?.map(|s| s.whole()).transpose()?;
    Ok((bytes, stride))
}

/// The bytes from `offset` on, if `count` elements fit.
fn slice_elements<'a>(
    place: &Item<'_>,
    bytes: &'a [u8],
    offset: usize,
    count: usize,
    stride: usize,
    element: usize,
) -> Result<&'a [u8], Error> {
    let end = match count {
        0 => Some(offset),
        n => (n - 1).checked_mul(stride).and_then(|x| x.checked_add(element)?.checked_add(offset)),
    };
    end.filter(|&end| end <= bytes.len()).and_then(|_| bytes.get(offset..)).ok_or_else(|| {
        place.fail(format!(
            "{count} elements do not fit into the {} bytes of their bufferView",
            bytes.len()
        ))
    })
}

fn parse_sparse<'a>(
    doc: &'a Document<'_>,
    sparse: &Item<'_>,
    count: usize,
    element: usize,
    budget: &mut Budget,
) -> Result<(Vec<u32>, &'a [u8]), Error> {
    let sparse_count_item = sparse.required("count")?;
    let sparse_count = sparse_count_item.whole()?;
    let part = |key: &str| -> Result<(Item<'_>, &'a [u8], usize), Error> {
        let part = sparse.required(key)?;
        let (bytes, _) = view_bytes(doc, &part.required("bufferView")?)?;
        let offset = part.field("byteOffset")?.map_or(Ok(0), |o| o.whole())?;
        Ok((part, bytes, offset))
    };
    let (indices_item, bytes, offset) = part("indices")?;
    let code = indices_item.required("componentType")?;
    let component = match Component::from_code(code.whole()?) {
        Some(c @ (Component::U8 | Component::U16 | Component::U32)) => c,
        _ => return Err(code.fail("sparse indices allow the formats 5121, 5123, 5125")),
    };
    let size = component.byte_size();
    let bytes = slice_elements(&sparse_count_item, bytes, offset, sparse_count, size, size)?;
    // Each use of the accessor reads them anew: the number of uses times their count is bounded.
    budget.take::<u32>(sparse_count as u64, &sparse_count_item)?;
    let packed = Accessor {
        count: sparse_count,
        width: 1,
        component,
        normalized: false,
        base: Some((bytes, size)),
        sparse: None,
    };
    let indices: Vec<u32> = (0..sparse_count).map(|i| packed.read_index(i)).collect();
    let in_range = indices.last().is_none_or(|&last| (last as usize) < count);
    if !in_range || indices.windows(2).any(|w| w[0] >= w[1]) {
        return Err(indices_item.fail(format!("must ascend strictly and stay below {count}")));
    }
    let (_, values, offset) = part("values")?;
    let values =
        slice_elements(&sparse_count_item, values, offset, sparse_count, element, element)?;
    Ok((indices, values))
}
