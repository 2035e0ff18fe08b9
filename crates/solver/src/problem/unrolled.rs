//! Loops of few turns that are written out.
//!
//! A compiler unrolls such a loop too late, or not at all, and dual numbers then stay in memory: it does not see which of them
//! have no derivative.

/// Turns that are written out.
pub(crate) const UNROLLED: usize = 12;

/// `unrolled!(i < N => { … })` is `for i in 0..N { … }`, of which the first [`UNROLLED`] turns are written out.
macro_rules! unrolled {
    ($i:ident < $n:expr => $body:block) => {{
        let n: usize = $n;
        $crate::problem::unrolled::unrolled!(@ $i n $body 0 1 2 3 4 5 6 7 8 9 10 11);
        for $i in 12..n $body
    }};
    (@ $i:ident $n:ident $body:block $($k:literal)*) => {$(
        if $k < $n {
            let $i: usize = $k;
            $body
        }
    )*};
}

pub(crate) use unrolled;
