use crate::hook::Board;
use crate::piece::{BoardSide, Constant, Context, Options, Parameter, Piece, Scalar};

const WIDTH: Constant = Constant::new("width_mm", "width", "mm", 200.0).of_board(BoardSide::Width);
const HEIGHT: Constant = Constant::new("height_mm", "height", "mm", 200.0).of_board(BoardSide::Height);

/// The surface of the board is uneven: terms of third and fourth degree of its height over its own plane. Those of second degree
/// are [`BoardBow`](super::BoardBow)'s, to which these are nearly orthogonal.
#[derive(Debug, Clone, Copy)]
pub struct BoardWarp {
    /// Width and height of the rectangle of the markers, mm, with a corner at the origin.
    pub size_mm: [f64; 2],
}

impl BoardWarp {
    /// With the constants that are given by name, and defaults for the others.
    pub fn with_options(given: &Options) -> Self {
        Self { size_mm: [WIDTH.of(given), HEIGHT.of(given)] }
    }
}

const fn height(name: &'static str) -> Parameter {
    Parameter::new(name, "mm", 0.0, 0.1).meaning("Height of the board's surface in this polynomial at its corners.")
}

/// Coordinate beyond which the surface continues level: far from the markers the polynomials would be anything.
const EDGE: f64 = 1.2;

/// The Legendre polynomials of degree 0 to 4.
#[inline(always)]
fn legendre<T: Scalar>(t: T) -> [T; 5] {
    let t = if t.re().abs() > EDGE { T::from(EDGE.copysign(t.re())) } else { t };
    let s = t * t;
    let one = T::from(1.0);
    [one, t, s * 1.5 - 0.5, (s * 2.5 - 1.5) * t, (s * 35.0 - 30.0) * s / 8.0 + 0.375]
}

impl Piece<Board, 9> for BoardWarp {
    const NAME: &'static str = "board_warp";
    const SUMMARY: &'static str = "the board's surface is uneven beyond a bow";
    const EQUATION: &'static str =
        "Z + Σ hij Pᵢ(ξ) Pⱼ(η), 3 ≤ i + j ≤ 4, Legendre polynomials, ξ and η from −1 to 1 over the markers";
    const SOURCE: &'static str = "boards are not flat: Strobl, Hirzinger 2011, More accurate pinhole camera calibration with \
                                  imperfect planar target; fourth-order expansion of the surface";
    const PARAMETERS: [Parameter; 9] = [
        height("h30"),
        height("h21"),
        height("h12"),
        height("h03"),
        height("h40"),
        height("h31"),
        height("h22"),
        height("h13"),
        height("h04"),
    ];
    const CONSTANTS: &'static [Constant] = &[WIDTH, HEIGHT];

    #[inline(always)]
    fn map<T: Scalar>(&self, [x, y, z]: [T; 3], h: [T; 9], _: &Context) -> [T; 3] {
        let [p, q] = [legendre(x * (2.0 / self.size_mm[0]) - 1.0), legendre(y * (2.0 / self.size_mm[1]) - 1.0)];
        let cubic = h[0] * p[3] + h[1] * p[2] * q[1] + h[2] * p[1] * q[2] + h[3] * q[3];
        let quartic = h[4] * p[4] + h[5] * p[3] * q[1] + h[6] * p[2] * q[2] + h[7] * p[1] * q[3] + h[8] * q[4];
        [x, y, z + cubic + quartic]
    }

    fn options(&self) -> Vec<(&'static str, f64)> {
        vec![(WIDTH.name, self.size_mm[0]), (HEIGHT.name, self.size_mm[1])]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bonnet's recursion, (n + 1) Pₙ₊₁ = (2n + 1) t Pₙ − n Pₙ₋₁.
    #[test]
    fn polynomials_are_legendre_s() {
        for i in -10..=10 {
            let t = f64::from(i) / 10.0;
            let p = legendre(t);
            for n in 1..4 {
                let next = ((2 * n + 1) as f64 * t * p[n] - n as f64 * p[n - 1]) / (n + 1) as f64;
                assert!((p[n + 1] - next).abs() < 1e-14, "P{}({t}) = {} and not {next}", n + 1, p[n + 1]);
            }
        }
    }
}
