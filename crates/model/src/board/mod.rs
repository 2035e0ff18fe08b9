//! Board pieces: the nominal board to the real one.

crate::register::pieces! {
    board_bow: BoardBow => add(BoardBow::with_options),
    board_warp: BoardWarp => add(BoardWarp::with_options),
    print_scale: PrintScale => add(|_| PrintScale),
}
