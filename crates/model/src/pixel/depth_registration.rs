use crate::hook::Pixel;
use crate::piece::{Context, Parameter, Piece, Scalar};

/// The depth image is displaced against the image: what the image shows at (u, v), the depth image shows at
/// (u + du, v + dv).
#[derive(Debug, Clone, Copy)]
pub struct DepthRegistration;

impl Piece<Pixel, 2> for DepthRegistration {
    const NAME: &'static str = "depth_registration";
    const SUMMARY: &'static str = "the depth image is displaced against the image";
    const EQUATION: &'static str = "(u + du, v + dv)";
    const SOURCE: &'static str = "window offset of block matching; Herrera, Kannala, Heikkilä 2012, section 3.3";
    const PARAMETERS: [Parameter; 2] = [
        Parameter::new("du", "px", 0.0, 0.5).meaning("The depth image is displaced sideways against the image."),
        Parameter::new("dv", "px", 0.0, 0.5).meaning("The depth image is displaced up or down against the image."),
    ];

    #[inline(always)]
    fn map<T: Scalar>(&self, [u, v]: [T; 2], [du, dv]: [T; 2], _: &Context) -> [T; 2] {
        [u + du, v + dv]
    }
}
