//! Board pieces: the nominal board to the real one.

crate::register::pieces! {
    board_bow: BoardBow => add(|_| BoardBow),
    board_warp: BoardWarp => add(BoardWarp::with_options),
    print_scale: PrintScale => add(|_| PrintScale),
}
