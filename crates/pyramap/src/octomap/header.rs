//! The lines of text at the start of a file.

use crate::error::{Error, Result};
use std::path::Path;

const FULL_FIRST: &str = "# Octomap OcTree file";
const BINARY_FIRST: &str = "# Octomap OcTree binary file";
const SECOND: &str = "# (feel free to add / change comments, but leave the first line as it is!)";

/// What a file keeps of each node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// `.bt`: free or occupied.
    Binary,
    /// `.ot`: a log-odd.
    Full,
}

impl Format {
    /// The format that a path's ending names.
    pub fn of_path(path: &Path) -> Result<Self> {
        let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        match ending.as_str() {
            "bt" => Ok(Format::Binary),
            "ot" => Ok(Format::Full),
            _ => Err(Error::Parameter {
                name: "path",
                got: format!("{:?}", path.display().to_string()),
                expected: "an ending of .bt (states) or .ot (log-odds)".into(),
            }),
        }
    }
}

/// What the header says.
#[derive(Debug, PartialEq)]
pub struct Header {
    pub format: Format,
    /// Whether nodes have a colour.
    pub colour: bool,
    /// How many nodes there are, inner ones too.
    pub nodes: u64,
    /// Edge of a voxel, metres.
    pub voxel_size: f64,
}

impl Header {
    /// Takes the header off the start of a file. As in OctoMap, comments and lines with unknown words are skipped.
    pub fn read(rest: &mut &[u8]) -> std::result::Result<Self, String> {
        let first = take_line(rest).unwrap_or_default();
        let format = if first.starts_with(BINARY_FIRST) {
            Format::Binary
        } else if first.starts_with(FULL_FIRST) {
            Format::Full
        } else {
            return Err(format!("not an OctoMap file, whose first line is {FULL_FIRST:?} or {BINARY_FIRST:?}"));
        };
        let (mut id, mut size, mut res) = (None, None, None);
        loop {
            let line = take_line(rest).ok_or("cut off in its header")?;
            let mut words = line.split_whitespace();
            let slot = match words.next() {
                Some("data") => break,
                Some("id") => &mut id,
                Some("size") => &mut size,
                Some("res") => &mut res,
                _ => continue,
            };
            *slot = words.next().map(str::to_owned);
        }
        let missing = |word: &str| format!("its header has no {word:?}");
        let (id, size) = (id.ok_or_else(|| missing("id"))?, size.ok_or_else(|| missing("size"))?);
        let res = res.ok_or_else(|| missing("res"))?;
        let colour = match id.as_str() {
            "OcTree" => false,
            "ColorOcTree" => true,
            _ => return Err(format!("holds a tree of type {id:?}, expected \"OcTree\" or \"ColorOcTree\"")),
        };
        let nodes = size.parse().map_err(|_| format!("its size is {size:?}, expected a number of nodes"))?;
        let voxel_size = res.parse().ok().filter(|&res: &f64| res.is_finite() && res > 0.0);
        let voxel_size =
            voxel_size.ok_or_else(|| format!("its res is {res:?}, expected a positive number of metres"))?;
        Ok(Self { format, colour, nodes, voxel_size })
    }
}

/// The header that OctoMap writes before so many nodes.
pub fn text(format: Format, nodes: u64, voxel_size: f64) -> String {
    let first = match format {
        Format::Binary => BINARY_FIRST,
        Format::Full => FULL_FIRST,
    };
    format!("{first}\n{SECOND}\n#\nid OcTree\nsize {nodes}\nres {voxel_size}\ndata\n")
}

/// Takes one line off; `None` if none ends. What is no text is no word that means something.
fn take_line(rest: &mut &[u8]) -> Option<String> {
    let end = rest.iter().position(|&byte| byte == b'\n')?;
    let (line, after) = rest.split_at(end);
    *rest = &after[1..];
    Some(String::from_utf8_lossy(line).into_owned())
}
