//! Fields of ROS messages: CDR of ROS 2, and the packed layout of ROS 1.

use crate::recording::Layout;

/// Reads the fields of a message one after the other. `None` where the message ends before them.
pub(crate) struct Fields<'a> {
    rest: &'a [u8],
    /// Bytes that were read, from which CDR counts its alignment.
    position: usize,
    aligned: bool,
    big: bool,
}

impl<'a> Fields<'a> {
    /// The fields of a message; `None` where it has no encapsulation, or one that is not plain CDR.
    pub fn new(layout: Layout, data: &'a [u8]) -> Option<Self> {
        match layout {
            Layout::Cdr => {
                // Representation identifiers 0 and 1: CDR, big- and little-endian.
                let (&[0, order @ (0 | 1), _, _], fields) = data.split_first_chunk()? else { return None };
                Some(Fields { rest: fields, position: 0, aligned: true, big: order == 0 })
            }
            Layout::Ros1 => Some(Fields { rest: data, position: 0, aligned: false, big: false }),
            Layout::Track(_) | Layout::File | Layout::Pixels(..) | Layout::Unread => None,
        }
    }

    fn bytes(&mut self, count: usize) -> Option<&'a [u8]> {
        let (bytes, after) = self.rest.split_at_checked(count)?;
        self.rest = after;
        self.position += count;
        Some(bytes)
    }

    fn number<const N: usize>(&mut self) -> Option<[u8; N]> {
        if self.aligned {
            self.bytes(self.position.next_multiple_of(N) - self.position)?;
        }
        let mut bytes: [u8; N] = self.bytes(N)?.try_into().ok()?;
        if self.big {
            bytes.reverse();
        }
        Some(bytes)
    }

    pub fn u8(&mut self) -> Option<u8> {
        self.number().map(u8::from_le_bytes)
    }

    pub fn u32(&mut self) -> Option<u32> {
        self.number().map(u32::from_le_bytes)
    }

    pub fn f64(&mut self) -> Option<f64> {
        self.number().map(f64::from_le_bytes)
    }

    /// A string, without the zero that ends it in CDR.
    pub fn string(&mut self) -> Option<String> {
        let length = self.u32()? as usize;
        let bytes = self.bytes(length)?;
        let bytes = if self.aligned { bytes.strip_suffix(b"\0").unwrap_or(bytes) } else { bytes };
        Some(String::from_utf8_lossy(bytes).into_owned())
    }

    /// A sequence of bytes.
    pub fn blob(&mut self) -> Option<&'a [u8]> {
        let length = self.u32()? as usize;
        self.bytes(length)
    }

    /// A sequence of numbers.
    pub fn f64s(&mut self) -> Option<Vec<f64>> {
        let length = self.u32()?;
        (0..length).map(|_| self.f64()).collect()
    }

    /// `std_msgs/Header`: its time in ns.
    pub fn header(&mut self) -> Option<u64> {
        self.header_with_frame().map(|(time_ns, _)| time_ns)
    }

    /// `std_msgs/Header`: its time in ns, and the frame of coordinates.
    pub fn header_with_frame(&mut self) -> Option<(u64, String)> {
        if !self.aligned {
            self.u32()?;
        }
        let (seconds, nanoseconds) = (self.u32()?, self.u32()?);
        let frame = self.string()?;
        Some((u64::from(seconds) * 1_000_000_000 + u64::from(nanoseconds), frame))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn alignment_counts_from_behind_the_encapsulation() {
        // u8 7, three bytes of padding, u32 1, f64 at 8.
        let mut bytes = vec![0, 1, 0, 0, 7, 0, 0, 0, 1, 0, 0, 0];
        bytes.extend(2.5_f64.to_le_bytes());
        let mut fields = Fields::new(Layout::Cdr, &bytes).unwrap();
        assert_eq!((fields.u8(), fields.u32(), fields.f64(), fields.u8()), (Some(7), Some(1), Some(2.5), None));
        let packed = [7, 1, 0, 0, 0];
        let mut fields = Fields::new(Layout::Ros1, &packed).unwrap();
        assert_eq!((fields.u8(), fields.u32(), fields.u32()), (Some(7), Some(1), None));
        assert!(Fields::new(Layout::Cdr, &[0, 7, 0, 0]).is_none());
    }

    #[test]
    fn lengths_beyond_the_message_are_no_allocation() {
        let bytes = [0, 1, 0, 0, 255, 255, 255, 255, 1, 2];
        assert!(Fields::new(Layout::Cdr, &bytes).unwrap().blob().is_none());
        assert!(Fields::new(Layout::Cdr, &bytes).unwrap().string().is_none());
        assert!(Fields::new(Layout::Cdr, &bytes).unwrap().f64s().is_none());
    }
}
