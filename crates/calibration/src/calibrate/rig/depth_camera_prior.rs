//! Priors of pinhole and lens of a depth camera without images, and the parameters that its boards determine no better.

use crate::adjust::blocks::is_depth_only;
use depthcal_io::LeftOpen;
use depthcal_model::hook::HookKind;
use depthcal_model::{Block, Camera};

use crate::adjust::state::ParameterPrior;

/// Standard deviations of declared intrinsics: focal lengths in shares of their values, the principal point in image widths, and
/// coefficients of the lens in those that are usual.
const DECLARED: [f64; 3] = [0.03, 0.02, 1.0];
/// … and of assumed ones: of a lens of which nothing is known, k2 and k3 may be as large as 0.5.
const ASSUMED: [f64; 3] = [0.2, 0.06, 5.0];
/// Share of the prior's standard deviation above which the boards say less than the prior.
const LESS_THAN_PRIOR: f64 = 0.5;

/// Priors of the free parameters that only images of this camera determine well: pinhole and lens, about the camera's values. The
/// board is one for all cameras.
pub fn priors_of(camera: &Camera, is_declared: bool) -> Vec<ParameterPrior> {
    let [focal, centre, lens] = if is_declared { DECLARED } else { ASSUMED };
    let mut priors = Vec::new();
    let is_of_image = |block: &Block| !is_depth_only(block) && block.hook() != HookKind::Board;
    for (number, block) in camera.blocks().iter().enumerate().filter(|(_, b)| is_of_image(b)) {
        for (component, parameter) in block.parameters().iter().enumerate().filter(|(i, _)| block.free[*i]) {
            let mean = block.theta[component];
            let sigma = match (block.piece().is_none(), &*parameter.name) {
                (true, "fx" | "fy") => focal * mean.abs(),
                (true, _) => centre * camera.width as f64,
                (false, _) => lens * parameter.scale,
            };
            priors.push(ParameterPrior { block: number, component, mean, sigma });
        }
    }
    priors
}

/// The parameters whose priors say more than the boards, given the standard deviations of all parameters in the order of
/// [`Camera::theta`].
pub fn left_open(
    camera: &Camera,
    priors: &[ParameterPrior],
    std_devs: &[Option<f64>],
    is_declared: bool,
) -> Vec<LeftOpen> {
    let blocks: Vec<(&Block, std::ops::Range<usize>)> = camera.blocks_with_ranges().collect();
    let open = priors.iter().filter_map(|prior| {
        let (block, range) = &blocks[prior.block];
        let std_dev = std_devs[range.start + prior.component]?;
        let parameter = &block.parameters()[prior.component];
        (std_dev > LESS_THAN_PRIOR * prior.sigma).then(|| {
            let declared_or_assumed = if is_declared { "the declared" } else { "the assumed" };
            let unit = if parameter.unit == "1" { String::new() } else { format!(" {}", parameter.unit) };
            LeftOpen {
                parameter: format!("{}.{}", block.name(), parameter.name),
                reason: format!(
                    "the boards determine it to ±{std_dev:.2e}{unit} only; a prior of ±{:.2e}{unit} about {declared_or_assumed} {:.4}{unit} holds it: \
                     declare the intrinsics, or capture boards that fill the image at more distances and tilts",
                    prior.sigma, prior.mean
                ),
            }
        })
    });
    open.collect()
}
