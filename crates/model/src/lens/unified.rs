use crate::hook::{Lens, LensState};
use crate::piece::{Context, Parameter, Piece, Role, Scalar};

/// The unified model of central cameras: the point is projected onto the unit sphere, from there through a centre ξ above the
/// sphere's onto a plane, and then distorted radially and tangentially as Brown–Conrady does. Kalibr's `omni` with `radtan`,
/// OpenCV's `omnidir`.
///
/// Domain: without distortion it is monotone for all rays in front of the camera where ξ ≥ 0; with it, up to the radius m of the
/// plane at which 1 + 3 k1 m² + 5 k2 m⁴ = 0.
#[derive(Debug, Clone, Copy)]
pub struct Unified;

impl Piece<Lens, 5> for Unified {
    const NAME: &'static str = "unified";
    const TITLE: Option<&'static str> = Some("Lens, unified model");
    const SUMMARY: &'static str = "a wide lens or a mirror, by projection over a sphere";
    const EQUATION: &'static str = "m (1 + k1 m² + k2 m⁴) + (2 p1 mx my + p2 (m² + 2 mx²), p1 (m² + 2 my²) + 2 p2 mx my), \
                                    m = (x, y) / (1 + ξ √(1 + r²))";
    const SOURCE: &'static str = "Mei, Rives 2007, Single view point omnidirectional camera calibration from planar grids; Geyer, Daniilidis 2000";
    const PARAMETERS: [Parameter; 5] = [
        Parameter::new("xi", "1", 0.0, 0.3)
            .meaning("Distance of the centre of projection from the sphere's centre, in radii."),
        Parameter::new("k1", "1", 0.0, 0.1).meaning("Radial distortion on the plane."),
        Parameter::new("k2", "1", 0.0, 0.1).meaning("The same, of fourth order."),
        Parameter::new("p1", "1", 0.0, 1e-3).meaning("Decentring along y."),
        Parameter::new("p2", "1", 0.0, 1e-3).meaning("Decentring along x."),
    ];
    const ROLE: Role = Role::Model;

    #[inline(always)]
    fn map<T: Scalar>(&self, s: LensState<T>, [xi, k1, k2, p1, p2]: [T; 5], _: &Context) -> [T; 2] {
        let length = (s.x * s.x + s.y * s.y + 1.0).sqrt();
        let scale = (xi * length + 1.0).recip();
        let (x, y) = (s.x * scale, s.y * scale);
        let (xx, yy, xy) = (x * x, y * y, x * y * 2.0);
        let m2 = xx + yy;
        let radial = (k2 * m2 + k1) * m2 + 1.0;
        [x * radial + p1 * xy + p2 * (m2 + xx * 2.0), y * radial + p1 * (m2 + yy * 2.0) + p2 * xy]
    }
}
