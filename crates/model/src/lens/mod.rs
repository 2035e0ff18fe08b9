//! Lens pieces: undistorted to distorted normalised coordinates.
//!
//! Every piece states its domain, where it is monotone: along every ray from the axis the distorted radius grows. A
//! [`Camera`](crate::Camera) finds the domain of its whole lens ([`Camera::lens_limit`](crate::Camera::lens_limit)).

crate::register::pieces! {
    brown_conrady: BrownConrady => add(|_| BrownConrady),
    opencv_lens: OpencvLens => add(|_| OpencvLens),
    kannala_brandt: KannalaBrandt => add(|_| KannalaBrandt),
    division: Division => add(|_| Division),
    unified: Unified => add(|_| Unified),
    cahvor: Cahvor => add(|_| Cahvor),
    thin_prism: ThinPrism => add(|_| ThinPrism),
    rational_distortion: RationalDistortion => add(|_| RationalDistortion),
    tilted_sensor: TiltedSensor => add(|_| TiltedSensor),
    focus_breathing: FocusBreathing => add(|_| FocusBreathing),
}
