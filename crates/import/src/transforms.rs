//! Places of the sensors of a recording: `tf_static`, and the extrinsics that the RealSense SDK's recorder notes for each stream.

use std::collections::BTreeMap;

use crate::fields::Fields;
use crate::recording::Packet;

/// A place as the rows of (R | t), mm.
pub(crate) type Rows = [f64; 12];

/// Largest deviation of a quaternion's norm from 1.
const ROUNDING: f64 = 1e-3;

/// Places that a recording states.
#[derive(Debug, Default)]
pub(crate) struct Transforms {
    /// Of a frame in its parent's coordinates, by its name: `tf_static`.
    of_frames: BTreeMap<String, (String, Rows)>,
    /// From a group's reference to a stream: the beginning of the names of its topics, and the group.
    of_streams: Vec<(String, String, Rows)>,
}

/// Frames above each other at most; a tree with a circle has no end.
const DEEPEST: usize = 64;

impl Transforms {
    /// Takes up a message if it states places; false where it does not.
    pub fn add(&mut self, packet: &Packet<'_>) -> bool {
        let name = &packet.stream.name;
        if packet.stream.kind == "tf2_msgs/TFMessage" && name.ends_with("tf_static") {
            self.add_frames(packet);
            return true;
        }
        // /device_0/sensor_0/Depth_0/tf/0
        let Some((stream, group)) =
            name.rsplit_once("/tf/").filter(|_| packet.stream.kind == "geometry_msgs/Transform")
        else {
            return false;
        };
        if let Some(rows) = Fields::new(packet.layout, &packet.data).and_then(|mut fields| transform(&mut fields)) {
            let device = stream.split('/').find(|part| part.starts_with("device_")).unwrap_or_default();
            self.of_streams.push((format!("{stream}/"), format!("{device} {group}"), rows));
        }
        true
    }

    fn add_frames(&mut self, packet: &Packet<'_>) {
        let Some(mut fields) = Fields::new(packet.layout, &packet.data) else { return };
        let count = fields.u32().unwrap_or(0);
        for _ in 0..count {
            let read = fields
                .header_with_frame()
                .and_then(|(_, parent)| Some((parent, fields.string()?, transform(&mut fields)?)));
            let Some((parent, child, rows)) = read else { return };
            self.of_frames.insert(plain(&child).to_owned(), (plain(&parent).to_owned(), rows));
        }
    }

    /// The place of the second stream's sensor, from the coordinates of the first's, each given by its topic and the frame of its
    /// messages; `None` where the recording does not state both.
    pub fn between(&self, [first, second]: [(&str, &str); 2]) -> Option<Rows> {
        let of_stream =
            |(topic, _): (&str, &str)| self.of_streams.iter().find(|(prefix, ..)| topic.starts_with(prefix.as_str()));
        if let (Some((_, a, to_first)), Some((_, b, to_second))) = (of_stream(first), of_stream(second)) {
            return (a == b).then(|| product(to_second, &inverse(to_first)));
        }
        let [(root, of_first), (other, of_second)] = [self.in_root(first.1)?, self.in_root(second.1)?];
        (root == other && first.1 != second.1).then(|| product(&inverse(&of_second), &of_first))
    }

    /// The uppermost frame above one, and the one's place in it.
    fn in_root(&self, frame: &str) -> Option<(String, Rows)> {
        let mut name = plain(frame).to_owned();
        let (mut rows, mut is_known) = (IDENTITY, false);
        for _ in 0..DEEPEST {
            match self.of_frames.get(&name) {
                Some((parent, in_parent)) => {
                    rows = product(in_parent, &rows);
                    (name, is_known) = (parent.clone(), true);
                }
                None => {
                    return (is_known || self.of_frames.values().any(|(parent, _)| *parent == name))
                        .then_some((name, rows));
                }
            }
        }
        None
    }
}

/// Frames of ROS 1 may begin with a slash.
fn plain(frame: &str) -> &str {
    frame.strip_prefix('/').unwrap_or(frame)
}

const IDENTITY: Rows = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];

/// `geometry_msgs/Transform`: translation in m, and a quaternion x y z w.
fn transform(fields: &mut Fields<'_>) -> Option<Rows> {
    let mut numbers = [0.0; 7];
    for number in &mut numbers {
        *number = fields.f64()?;
    }
    let [tx, ty, tz, x, y, z, w] = numbers;
    let norm = (x * x + y * y + z * z + w * w).sqrt();
    if (norm - 1.0).abs() > ROUNDING || ![tx, ty, tz].iter().all(|t| t.abs() < 100.0) {
        return None;
    }
    let [x, y, z, w] = [x, y, z, w].map(|q| q / norm);
    let [tx, ty, tz] = [tx, ty, tz].map(|t| 1000.0 * t);
    Some([
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - z * w),
        2.0 * (x * z + y * w),
        tx,
        2.0 * (x * y + z * w),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - x * w),
        ty,
        2.0 * (x * z - y * w),
        2.0 * (y * z + x * w),
        1.0 - 2.0 * (x * x + y * y),
        tz,
    ])
}

/// The second place, then the first.
fn product(a: &Rows, b: &Rows) -> Rows {
    std::array::from_fn(|i| {
        let (row, column) = (i / 4, i % 4);
        let rotated: f64 = (0..3).map(|k| a[4 * row + k] * b[4 * k + column]).sum();
        if column == 3 { rotated + a[4 * row + 3] } else { rotated }
    })
}

fn inverse(a: &Rows) -> Rows {
    std::array::from_fn(|i| {
        let (row, column) = (i / 4, i % 4);
        match column {
            3 => -(0..3).map(|k| a[4 * k + row] * a[4 * k + 3]).sum::<f64>(),
            _ => a[4 * column + row],
        }
    })
}

#[cfg(test)]
mod tests {
    use std::borrow::Cow;

    use super::*;
    use crate::recording::{Layout, StreamInfo};

    fn text(bytes: &mut Vec<u8>, text: &str) {
        bytes.extend((text.len() as u32).to_le_bytes());
        bytes.extend(text.as_bytes());
    }

    fn numbers(bytes: &mut Vec<u8>, numbers: [f64; 7]) {
        numbers.iter().for_each(|number| bytes.extend(number.to_le_bytes()));
    }

    fn add(transforms: &mut Transforms, [name, kind]: [&str; 2], data: Vec<u8>) -> bool {
        let stream = StreamInfo { name: name.to_owned(), kind: kind.to_owned() };
        transforms.add(&Packet { stream: &stream, layout: Layout::Ros1, time_ns: 0, data: Cow::Owned(data) })
    }

    /// A quarter turn about z, and its half.
    const QUARTER: [f64; 4] = [0.0, 0.0, std::f64::consts::FRAC_1_SQRT_2, std::f64::consts::FRAC_1_SQRT_2];

    fn near(rows: Option<Rows>, expected: Rows) {
        let rows = rows.unwrap();
        assert!(rows.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{rows:?}");
    }

    /// The left camera is 30 mm along x of the base, the right one 80 mm and turned by a quarter: what is ahead along x for the
    /// left is along −y for the right.
    #[test]
    fn frames_of_one_tree_are_placed_against_each_other() {
        let mut message = 2_u32.to_le_bytes().to_vec();
        for (child, x, [qx, qy, qz, qw]) in [("left", 0.03, [0.0, 0.0, 0.0, 1.0]), ("/right", 0.08, QUARTER)] {
            message.extend([0; 12]);
            text(&mut message, "base");
            text(&mut message, child);
            numbers(&mut message, [x, 0.0, 0.0, qx, qy, qz, qw]);
        }
        let mut transforms = Transforms::default();
        assert!(add(&mut transforms, ["/tf_static", "tf2_msgs/TFMessage"], message));
        let rows = transforms.between([("a", "left"), ("b", "right")]);
        near(rows, [0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 50.0, 0.0, 0.0, 1.0, 0.0]);
        near(
            transforms.between([("a", "base"), ("b", "left")]),
            [1.0, 0.0, 0.0, -30.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0],
        );
        assert!(transforms.between([("a", "left"), ("b", "elsewhere")]).is_none());
    }

    /// Each stream has its place from the reference of its group.
    #[test]
    fn streams_of_one_group_are_placed_against_each_other() {
        let mut transforms = Transforms::default();
        for (topic, x) in [("/device_0/sensor_0/Depth_0/tf/0", 0.0), ("/device_0/sensor_1/Color_0/tf/0", 0.015)] {
            let mut message = Vec::new();
            numbers(&mut message, [x, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
            assert!(add(&mut transforms, [topic, "geometry_msgs/Transform"], message));
        }
        let mut message = Vec::new();
        numbers(&mut message, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
        add(&mut transforms, ["/device_0/sensor_2/Gyro_0/tf/1", "geometry_msgs/Transform"], message);
        let [colour, depth, gyro] =
            ["sensor_1/Color_0/image/data", "sensor_0/Depth_0/image/data", "sensor_2/Gyro_0/imu/data"]
                .map(|name| format!("/device_0/{name}"));
        let rows = transforms.between([(&colour, ""), (&depth, "")]);
        near(rows, [1.0, 0.0, 0.0, -15.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        assert!(transforms.between([(&colour, ""), (&gyro, "")]).is_none());
    }

    #[test]
    fn what_is_no_rotation_is_left_out() {
        let mut transforms = Transforms::default();
        let mut message = Vec::new();
        numbers(&mut message, [0.0; 7]);
        assert!(add(&mut transforms, ["/device_0/sensor_0/Depth_0/tf/0", "geometry_msgs/Transform"], message));
        assert!(transforms.of_streams.is_empty());
        // A circle has no uppermost frame.
        transforms.of_frames.insert("a".into(), ("b".into(), IDENTITY));
        transforms.of_frames.insert("b".into(), ("a".into(), IDENTITY));
        assert!(transforms.between([("", "a"), ("", "b")]).is_none());
    }
}
