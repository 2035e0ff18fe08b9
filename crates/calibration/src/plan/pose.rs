//! Views of the board that could be captured, in numbers and in words.

/// Angle by which the board of a proposed frame is tilted, degrees.
const TILT_DEG: f64 = 45.0;

/// A view of the board that could be captured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProposedFrame {
    /// Depth of the board's middle, mm.
    pub distance_mm: f64,
    /// Place of the board in the image.
    pub place: ImagePlace,
    /// Tilt of the board.
    pub tilt: BoardTilt,
    /// Rise over the highest temperature of the captures, °C; `None` for their median temperature.
    pub warmer_c: Option<f64>,
}

/// Place of the board's middle in the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ImagePlace {
    /// The middle.
    Middle,
    /// The middle of the left edge.
    LeftEdge,
    /// The middle of the right edge.
    RightEdge,
    /// The middle of the upper edge.
    Top,
    /// The middle of the lower edge.
    Bottom,
    /// The upper left corner.
    UpperLeft,
    /// The upper right corner.
    UpperRight,
    /// The lower left corner.
    LowerLeft,
    /// The lower right corner.
    LowerRight,
}

impl ImagePlace {
    /// All places.
    pub const ALL: [Self; 9] = [
        Self::Middle,
        Self::LeftEdge,
        Self::RightEdge,
        Self::Top,
        Self::Bottom,
        Self::UpperLeft,
        Self::UpperRight,
        Self::LowerLeft,
        Self::LowerRight,
    ];
    /// Those at which frames that distinguish two effects are searched.
    pub const DIAGNOSED: [Self; 6] =
        [Self::Middle, Self::LeftEdge, Self::RightEdge, Self::Top, Self::UpperLeft, Self::LowerRight];

    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Middle => "in the middle",
            Self::LeftEdge => "at the left edge",
            Self::RightEdge => "at the right edge",
            Self::Top => "at the top",
            Self::Bottom => "at the bottom",
            Self::UpperLeft => "in the upper left corner",
            Self::UpperRight => "in the upper right corner",
            Self::LowerLeft => "in the lower left corner",
            Self::LowerRight => "in the lower right corner",
        }
    }

    /// Column and row as shares of the image's width and height.
    pub fn position(self) -> [f64; 2] {
        match self {
            Self::Middle => [0.5, 0.5],
            Self::LeftEdge => [0.2, 0.5],
            Self::RightEdge => [0.8, 0.5],
            Self::Top => [0.5, 0.25],
            Self::Bottom => [0.5, 0.75],
            Self::UpperLeft => [0.2, 0.2],
            Self::UpperRight => [0.8, 0.2],
            Self::LowerLeft => [0.2, 0.8],
            Self::LowerRight => [0.8, 0.8],
        }
    }
}

/// Tilt of the board against the image plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum BoardTilt {
    /// Parallel to the image plane.
    Parallel,
    /// Turned about the vertical axis by this angle, degrees.
    AboutVertical(f64),
    /// Turned about the horizontal axis by this angle, degrees.
    AboutHorizontal(f64),
}

impl BoardTilt {
    /// Those that are tried.
    pub const ALL: [Self; 5] = [
        Self::Parallel,
        Self::AboutVertical(TILT_DEG),
        Self::AboutVertical(-TILT_DEG),
        Self::AboutHorizontal(TILT_DEG),
        Self::AboutHorizontal(-TILT_DEG),
    ];
    /// Those at which frames that distinguish two effects are searched.
    pub const DIAGNOSED: [Self; 3] = [Self::Parallel, Self::AboutVertical(TILT_DEG), Self::AboutHorizontal(TILT_DEG)];

    /// In words, for who looks along with the camera: a positive angle about the vertical axis (down) brings the board's right
    /// side nearer, one about the horizontal axis (to the right) its upper side.
    pub fn words(self) -> String {
        let tilted = |angle: f64, side: &str| format!("tilted by {:.0}°, its {side} side nearer", angle.abs());
        match self {
            Self::Parallel => "parallel to the image".to_owned(),
            Self::AboutVertical(angle) if angle > 0.0 => tilted(angle, "right"),
            Self::AboutVertical(angle) => tilted(angle, "left"),
            Self::AboutHorizontal(angle) if angle > 0.0 => tilted(angle, "upper"),
            Self::AboutHorizontal(angle) => tilted(angle, "lower"),
        }
    }

    /// Angles about the horizontal (x) and the vertical (y) axis, degrees.
    pub fn angles_deg(self) -> [f64; 2] {
        match self {
            Self::Parallel => [0.0, 0.0],
            Self::AboutVertical(angle) => [0.0, angle],
            Self::AboutHorizontal(angle) => [angle, 0.0],
        }
    }
}

impl ProposedFrame {
    /// In words: distance, place in the image, tilt.
    pub fn words(&self) -> String {
        let distance = match self.distance_mm {
            mm if mm < 1000.0 => format!("{:.0} mm", (mm / 10.0).round() * 10.0),
            mm => format!("{:.2} m", mm / 1000.0),
        };
        let warmer = self.warmer_c.map_or_else(String::new, |c| format!(", {c:.0} °C warmer"));
        format!("{distance} away, {}, {}{warmer}", self.place.words(), self.tilt.words())
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, UnitQuaternion, Vector3};

    use super::*;

    /// The side that words call nearer has the smaller z after the rotation by the angles: x is to the right, y down.
    #[test]
    fn the_nearer_side_is_named() {
        let sides = [("left", [-1.0, 0.0]), ("right", [1.0, 0.0]), ("upper", [0.0, -1.0]), ("lower", [0.0, 1.0])];
        for tilt in BoardTilt::ALL {
            let [about_x, about_y] = tilt.angles_deg().map(f64::to_radians);
            let rotation = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), about_x)
                * UnitQuaternion::from_axis_angle(&Vector3::y_axis(), about_y);
            for (side, [x, y]) in sides {
                let nearer = (rotation * Point3::new(x, y, 0.0)).z < -0.1;
                assert_eq!(tilt.words().contains(side), nearer, "{tilt:?} {side}");
            }
        }
    }
}
