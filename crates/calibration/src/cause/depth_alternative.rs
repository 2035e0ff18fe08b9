//! The alternatives to declared depth: how the depth image lies on the image, its quantity, its frame.
//! One entry of [`Turn::ALL`], [`Quantity::ALL`] or [`DepthAlternative::FRAMES`] per alternative; all combinations are tried.

use std::fmt;

/// How the depth image lies on the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Turn {
    /// As it should.
    Upright,
    /// Columns in the other order.
    LeftRight,
    /// Rows in the other order.
    UpDown,
    /// Both.
    HalfTurn,
    /// Turned by 90° clockwise.
    Clockwise,
    /// Turned by 90° anticlockwise.
    Anticlockwise,
    /// Columns and rows exchanged.
    Transposed,
    /// Columns and rows exchanged, and turned by half a turn.
    TransposedHalfTurn,
}

impl Turn {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Upright,
        Self::LeftRight,
        Self::UpDown,
        Self::HalfTurn,
        Self::Clockwise,
        Self::Anticlockwise,
        Self::Transposed,
        Self::TransposedHalfTurn,
    ];

    /// The pixel of a depth image of this width and height that belongs to a pixel of the image; `None` where it has none, as
    /// after quarter turns of images that are no squares.
    pub fn depth_pixel(self, [u, v]: [usize; 2], [width, height]: [usize; 2]) -> Option<[usize; 2]> {
        let is_quarter =
            matches!(self, Self::Clockwise | Self::Anticlockwise | Self::Transposed | Self::TransposedHalfTurn);
        if u >= width || v >= height || (is_quarter && width != height) {
            return None;
        }
        let (right, low) = (width - 1, height - 1);
        Some(match self {
            Self::Upright => [u, v],
            Self::LeftRight => [right - u, v],
            Self::UpDown => [u, low - v],
            Self::HalfTurn => [right - u, low - v],
            Self::Clockwise => [low - v, u],
            Self::Anticlockwise => [v, right - u],
            Self::Transposed => [v, u],
            Self::TransposedHalfTurn => [low - v, right - u],
        })
    }

    /// The fault in words, after "the depth images are", and the remedy.
    fn words(self) -> Option<(&'static str, &'static str)> {
        let mirror = "mirror one of the two";
        Some(match self {
            Self::Upright => return None,
            Self::LeftRight => ("mirrored left to right against the images", mirror),
            Self::UpDown => ("mirrored top to bottom against the images", mirror),
            Self::HalfTurn => ("turned by 180° against the images", "turn one of the two"),
            Self::Clockwise => {
                ("turned by 90° clockwise against the images", "turn the depth images by 90° anticlockwise")
            }
            Self::Anticlockwise => {
                ("turned by 90° anticlockwise against the images", "turn the depth images by 90° clockwise")
            }
            Self::Transposed => ("transposed against the images", "exchange columns and rows of the depth images"),
            Self::TransposedHalfTurn => (
                "transposed and turned by 180° against the images",
                "exchange columns and rows of the depth images and turn them by 180°",
            ),
        })
    }
}

/// The quantity that a depth image holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// The coordinate along the optical axis, z.
    Depth,
    /// The distance from the camera along the ray.
    Range,
    /// z in whole steps of 16 bits whose two bytes are exchanged.
    ExchangedBytes,
    /// A disparity, affine in 1/z.
    Disparity,
}

/// Value of Kinect's raw disparity where nothing was measured.
const NO_DISPARITY: f64 = 2047.0;

impl Quantity {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Depth, Self::Range, Self::ExchangedBytes, Self::Disparity];

    /// The value proportional to z, or the disparity, that a raw value means; `None` where nothing was measured. `range_per_z` is
    /// the distance along the pixel's ray per z.
    pub fn value(self, raw: f64, range_per_z: f64) -> Option<f64> {
        match self {
            Self::Depth => Some(raw),
            Self::Range => Some(raw / range_per_z),
            Self::ExchangedBytes => {
                let is_steps = raw.fract() == 0.0 && (0.0..65536.0).contains(&raw);
                let exchanged = f64::from((raw as u16).swap_bytes());
                (is_steps && exchanged > 0.0 && exchanged < 65535.0).then_some(exchanged)
            }
            Self::Disparity => (raw != NO_DISPARITY).then_some(raw),
        }
    }
}

/// An alternative to depth as it is declared, or, of [`DepthAlternative::DECLARED`], the declaration.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DepthAlternative {
    /// How the depth image lies on the image.
    pub turn: Turn,
    /// The quantity that it holds.
    pub quantity: Quantity,
    /// The frame that it shows, counted from the frame to which it is declared to belong.
    pub frame: isize,
}

impl DepthAlternative {
    /// Depth as it is declared.
    pub const DECLARED: Self = Self { turn: Turn::Upright, quantity: Quantity::Depth, frame: 0 };
    /// The frames that depth may show.
    pub const FRAMES: [isize; 3] = [0, -1, 1];

    /// All combinations.
    pub fn all() -> impl Iterator<Item = Self> {
        Self::FRAMES.into_iter().flat_map(|frame| {
            Turn::ALL
                .into_iter()
                .flat_map(move |turn| Quantity::ALL.into_iter().map(move |quantity| Self { turn, quantity, frame }))
        })
    }

    /// By how many faults it differs from the declaration.
    pub fn faults(self) -> usize {
        usize::from(self.turn != Turn::Upright)
            + usize::from(self.quantity != Quantity::Depth)
            + usize::from(self.frame != 0)
    }
}

impl fmt::Display for DepthAlternative {
    /// The faults with their remedies.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let turn = self.turn.words().map(|(fault, remedy)| format!("the depth images are {fault}: {remedy}"));
        let quantity = match self.quantity {
            Quantity::Depth => None,
            Quantity::Range => Some(
                "the depth images hold ranges, distances along the rays, instead of z: divide every value by \
                                     the length of its pixel's ray (x, y, 1)",
            ),
            Quantity::ExchangedBytes => Some(
                "the two bytes of every value of the depth images are exchanged: write them in the \
                                             byte order of the format",
            ),
            Quantity::Disparity => Some("the depth images hold disparities, which are affine in 1/z, instead of depth"),
        };
        let frame = match self.frame {
            0 => None,
            -1 => Some("the depth image of every frame shows the frame before it"),
            _ => Some("the depth image of every frame shows the frame after it"),
        };
        let frame = frame.map(|fault| {
            format!("{fault}: pair the files in a table (frames.metadata with columns image and depth), or by their times (frames.within_s)")
        });
        let all: Vec<String> = turn.into_iter().chain(quantity.map(str::to_owned)).chain(frame).collect();
        f.write_str(&all.join("; and "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A depth image that was turned has its corners where the entry looks them up.
    #[test]
    fn every_turn_finds_the_pixel_where_the_turned_image_has_it() {
        let n = 5;
        let upright = |u: usize, v: usize| 10 * v + u;
        // The turned images by their definitions, as maps from a pixel of the turned image to one of the upright image.
        type Map = fn(usize, usize) -> [usize; 2];
        let turned: [(Turn, Map); 8] = [
            (Turn::Upright, |u, v| [u, v]),
            (Turn::LeftRight, |u, v| [4 - u, v]),
            (Turn::UpDown, |u, v| [u, 4 - v]),
            (Turn::HalfTurn, |u, v| [4 - u, 4 - v]),
            // Clockwise: the first row of the result is the first column of the image, read upwards.
            (Turn::Clockwise, |u, v| [v, 4 - u]),
            (Turn::Anticlockwise, |u, v| [4 - v, u]),
            (Turn::Transposed, |u, v| [v, u]),
            (Turn::TransposedHalfTurn, |u, v| [4 - v, 4 - u]),
        ];
        for (turn, from) in turned {
            for (u, v) in (0..n * n).map(|i| (i % n, i / n)) {
                let [p, q] = turn.depth_pixel([u, v], [n, n]).expect("within");
                let [x, y] = from(p, q);
                assert_eq!(upright(x, y), upright(u, v), "{turn:?}");
            }
        }
        assert_eq!(Turn::Clockwise.depth_pixel([0, 0], [6, 5]), None);
        assert_eq!(Turn::HalfTurn.depth_pixel([6, 0], [6, 5]), None);
    }

    #[test]
    fn every_quantity_has_its_value() {
        assert_eq!(Quantity::Depth.value(700.0, 1.1), Some(700.0));
        assert_eq!(Quantity::Range.value(770.0, 1.1).map(f64::round), Some(700.0));
        assert_eq!(Quantity::ExchangedBytes.value(f64::from(700u16.swap_bytes()), 1.1), Some(700.0));
        assert_eq!(Quantity::ExchangedBytes.value(0.7, 1.1), None);
        assert_eq!([2047.0, 600.0].map(|raw| Quantity::Disparity.value(raw, 1.1)), [None, Some(600.0)]);
    }

    #[test]
    fn all_faults_of_a_combination_are_named() {
        let all = DepthAlternative { turn: Turn::UpDown, quantity: Quantity::Range, frame: -1 };
        let text = all.to_string();
        assert!(["top to bottom", "ranges", "frame before it"].iter().all(|word| text.contains(word)), "{text}");
        assert_eq!((all.faults(), DepthAlternative::DECLARED.faults()), (3, 0));
        assert_eq!(DepthAlternative::all().filter(|one| one.faults() == 1).count(), 7 + 3 + 2);
    }
}
