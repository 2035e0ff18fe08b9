//! The linear algebra of one iteration: normal equations accumulated chunk by chunk, elimination by Schur complement, and
//! the solution of the reduced system by dense or sparse Cholesky, by conjugate gradients, or by QR of the Jacobian.

pub(crate) mod chunk;
pub(crate) mod conjugate_gradients;
pub(crate) mod constrain;
pub(crate) mod eliminate;
pub(crate) mod kernels;
pub(crate) mod lane_products;
mod linear;
pub(crate) mod normal_equations;
pub(crate) mod qr;
pub(crate) mod reduced_blocks;
pub(crate) mod reduced_system;
pub(crate) mod scatter;
pub(crate) mod selected_inverse;
mod weak_directions;
