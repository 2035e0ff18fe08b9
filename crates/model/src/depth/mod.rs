//! Depth pieces: true to measured inverse depth. Physical effects first, then fields over the image.

crate::register::pieces! {
    projective: Projective => add(|_| Projective),
    projector_distortion: ProjectorDistortion => add(ProjectorDistortion::with_options),
    disparity_ripple: DisparityRipple => add(DisparityRipple::with_options),
    range_offset: RangeOffset => add(|_| RangeOffset),
    quadratic_depth: QuadraticDepth => add(|_| QuadraticDepth),
    cyclic_depth: CyclicDepth => add(CyclicDepth::with_options),
    radial_range: RadialRange => add(|_| RadialRange),
    incidence_bias: IncidenceBias => add(|_| IncidenceBias),
    reflectivity_bias: ReflectivityBias => add(ReflectivityBias::with_options),
    signal_mixing: SignalMixing => add(|_| SignalMixing),
    stray_light: StrayLight => add(StrayLight::with_options),
    temporal_drift: TemporalDrift => add(TemporalDrift::with_options),
    temperature_drift: TemperatureDrift => add(TemperatureDrift::with_options),
    free_map: FreeMap => add_field(FreeMap::field),
    bspline: Bspline => add_field(Bspline::field),
    multiplier: Multiplier => add_field(Multiplier::field),
    disparity_decay: DisparityDecay => add_field(DisparityDecay::field),
    polynomial_map: PolynomialMap => add_field(PolynomialMap::field),
}
