//! Nonlinear least squares on factor graphs: typed variables, factors with automatic derivatives, sparse Levenberg-Marquardt.
