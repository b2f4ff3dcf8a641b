//! What a server gives and takes.

use crate::Address;
use crate::sdo::Abort;

/// An object dictionary, as a server uses it: one object at a time, in parts.
pub trait Dictionary {
    /// An object is going to be read: how many bytes it has. They do not change until the next object is asked for.
    ///
    /// # Errors
    /// Why it cannot be read.
    fn upload(&mut self, address: Address) -> Result<u32, Abort>;

    /// Bytes of that object from `offset` on, all of which it has; the same ones may be asked for again.
    fn read(&mut self, offset: u32, into: &mut [u8]);

    /// An object is going to be written, with so many bytes where that is said.
    ///
    /// # Errors
    /// Why it cannot be written.
    fn download(&mut self, address: Address, size: Option<u32>) -> Result<(), Abort>;

    /// The next bytes of that object. Until [`Dictionary::finish`] they are not its value.
    ///
    /// # Errors
    /// Why they are not taken; nothing more comes then.
    fn write(&mut self, bytes: &[u8]) -> Result<(), Abort>;

    /// All has come.
    ///
    /// # Errors
    /// Why it is not the object's value.
    fn finish(&mut self) -> Result<(), Abort>;

    /// No more comes of the object that is being written.
    fn discard(&mut self);

    /// The bytes of an object that always has as many, for writes that do not say how many theirs are.
    fn length(&self, address: Address) -> Option<u32> {
        let _ = address;
        None
    }
}
