//! Electronic data sheets of CANopen devices (CiA 306-1): EDS files, and the DCF files that are made from them.
//!
//! Sans-io: the bytes of a file go into a [`Reader`] in pieces, cut anywhere, and each object comes out as an [`Entry`] when
//! its section ends. Nothing is kept of what came out.
//!
//! Taken as real files have it: names of sections and keys in any case, lines that end with CR LF or LF, comments behind `;`
//! and `#`, text that is not UTF-8 (it is taken for Latin-1), hexadecimal and decimal numbers, empty values, unknown keys and
//! sections. What cannot be understood is an [`Error`] with its line.
//!
//! The document is CiA's own and not public. What is read here is what the parser of the Python package `canopen` 2.4
//! (objectdictionary/eds.py) reads; that a number with a leading zero is decimal is *assumed*.
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]

mod draft;
mod entry;
mod error;
mod number;
mod reader;
mod section;

pub use entry::{Access, DataType, Entry, Object};
pub use error::{Error, Mistake};
pub use number::Number;
pub use reader::Reader;

/// The longest line, in bytes; a longer comment is one all the same.
pub const LINE: usize = 255;
/// The longest name that is kept, in bytes; what is longer is cut.
pub const NAME: usize = 64;
/// The longest limit or value that is kept, in bytes; what is longer is cut. No number is.
pub const VALUE: usize = 40;
