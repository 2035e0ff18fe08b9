//! Messages of ROS by their definitions: packed as ROS 1 has them, and in the CDR of ROS 2.

/// A message of a topic.
pub struct Message {
    pub topic: String,
    pub time_ns: u64,
    pub body: Body,
}

/// The contents of a message.
#[derive(Clone)]
pub enum Body {
    /// `sensor_msgs/Image` of these sides and bytes per row.
    Image { size: [usize; 2], encoding: &'static str, step: usize, data: Vec<u8> },
    /// `sensor_msgs/CameraInfo` of the intrinsics fx, fy, cx, cy, px.
    Info { size: [usize; 2], model: &'static str, distortion: Vec<f64>, pinhole: [f64; 4] },
    /// `std_msgs/Float32`.
    Number(f32),
}

impl Message {
    /// `sensor_msgs/Image`, with `/msg/` in ROS 2.
    pub fn kind(&self, is_ros1: bool) -> String {
        let name = match self.body {
            Body::Image { .. } => "sensor_msgs/msg/Image",
            Body::Info { .. } => "sensor_msgs/msg/CameraInfo",
            Body::Number(_) => "std_msgs/msg/Float32",
        };
        if is_ros1 { name.replace("/msg/", "/") } else { name.to_owned() }
    }

    pub fn bytes(&self, is_ros1: bool) -> Vec<u8> {
        let mut fields = Fields { bytes: Vec::new(), is_ros1 };
        match &self.body {
            Body::Image { size: [width, height], encoding, step, data } => {
                fields.header(self.time_ns);
                fields.numbers(&[*height as u32, *width as u32]);
                fields.text(encoding);
                fields.bytes.push(0);
                fields.numbers(&[*step as u32, data.len() as u32]);
                fields.bytes.extend(data);
            }
            Body::Info { size: [width, height], model, distortion, pinhole: [fx, fy, cx, cy] } => {
                fields.header(self.time_ns);
                fields.numbers(&[*height as u32, *width as u32]);
                fields.text(model);
                fields.numbers(&[distortion.len() as u32]);
                fields.floats(distortion);
                fields.floats(&[*fx, 0.0, *cx, 0.0, *fy, *cy, 0.0, 0.0, 1.0]);
                fields.floats(&[0.0; 9 + 12]);
                // Binning, the region of interest and its flag.
                fields.numbers(&[0; 6]);
                fields.bytes.push(0);
            }
            Body::Number(number) => fields.bytes.extend(number.to_le_bytes()),
        }
        match is_ros1 {
            true => fields.bytes,
            // Little-endian CDR.
            false => [vec![0, 1, 0, 0], fields.bytes].concat(),
        }
    }
}

struct Fields {
    bytes: Vec<u8>,
    is_ros1: bool,
}

impl Fields {
    fn align(&mut self, size: usize) {
        if !self.is_ros1 {
            self.bytes.resize(self.bytes.len().next_multiple_of(size), 0);
        }
    }

    fn header(&mut self, time_ns: u64) {
        if self.is_ros1 {
            self.numbers(&[7]);
        }
        self.numbers(&[(time_ns / 1_000_000_000) as u32, (time_ns % 1_000_000_000) as u32]);
        self.text("camera");
    }

    fn numbers(&mut self, numbers: &[u32]) {
        self.align(4);
        self.bytes.extend(numbers.iter().flat_map(|n| n.to_le_bytes()));
    }

    fn floats(&mut self, floats: &[f64]) {
        if !floats.is_empty() {
            self.align(8);
        }
        self.bytes.extend(floats.iter().flat_map(|f| f.to_le_bytes()));
    }

    fn text(&mut self, text: &str) {
        // CDR counts the zero that ends a string.
        let end: &[u8] = if self.is_ros1 { b"" } else { b"\0" };
        self.numbers(&[(text.len() + end.len()) as u32]);
        self.bytes.extend([text.as_bytes(), end].concat());
    }
}
