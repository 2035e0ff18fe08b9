//! MCAP, by the `mcap` crate: ROS 2's default, also with messages of ROS 1.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use mcap::io::MessageReader;

use super::packet::{Layout, Packet, StreamInfo, Visitor, damaged, plain_type};
use crate::error::ImportError;

pub(super) fn visit(
    path: &Path,
    wanted: &dyn Fn(&StreamInfo) -> bool,
    visitor: &mut Visitor<'_>,
) -> Result<(), ImportError> {
    let file = File::open(path).map_err(|error| ImportError::Read { path: path.to_owned(), error })?;
    let mut streams: BTreeMap<u16, (StreamInfo, Layout, bool)> = BTreeMap::new();
    for message in MessageReader::new(BufReader::new(file)) {
        let message = message.map_err(|error| damaged(path, "MCAP", error))?;
        let channel = &message.channel;
        let (stream, layout, is_wanted) = streams.entry(channel.id).or_insert_with(|| {
            let kind = channel.schema.as_ref().map_or_else(String::new, |schema| plain_type(&schema.name));
            let stream = StreamInfo { name: channel.topic.clone(), kind };
            let layout = if channel.message_encoding == "ros1" { Layout::Ros1 } else { Layout::Cdr };
            let readable = ["cdr", "ros1"].contains(&channel.message_encoding.as_str());
            let is_wanted = readable && wanted(&stream);
            (stream, layout, is_wanted)
        });
        if *is_wanted {
            let packet = Packet { stream, layout: *layout, time_ns: message.log_time, data: message.data };
            if visitor(packet)?.is_break() {
                break;
            }
        }
    }
    Ok(())
}
