/// The role of a piece in a search for missing effects.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Part of the declared model: the lens, D. Never a finding.
    Model,
    /// One physical effect with few parameters: may be missing, and is then named.
    Effect,
    /// A free map that takes up anything smooth: a competitor of effects, never a finding.
    Map,
}
