//! The functions that read and write the file of a record.

/// Gives a record `read` and `write`, by functions for the types of its path and contents alone, so that callers do not compile
/// them again.
macro_rules! result_file {
    ($record:ident, $name:literal, $read:path, $write:path) => {
        impl $record {
            #[doc = concat!("Reads `", $name, "`.")]
            ///
            /// # Errors
            /// [`FileError`](crate::FileError) with file and field: another format or version, a missing field, a number out of
            /// its range.
            pub fn read(path: impl AsRef<std::path::Path>) -> Result<Self, crate::FileError> {
                $read(path.as_ref())
            }

            #[doc = concat!("Writes `", $name, "` atomically; every number reads back with the same bits.")]
            ///
            /// # Errors
            /// [`FileError`](crate::FileError) with the field that is not finite or out of its range, or with the file; nothing
            /// is written.
            pub fn write(&self, path: impl AsRef<std::path::Path>) -> Result<(), crate::FileError> {
                $write(path.as_ref(), self)
            }
        }
    };
}
pub(super) use result_file;
