//! Board pieces: the nominal board to the real one.

crate::register::pieces! {
    board_bow: BoardBow => add(|_| BoardBow),
    print_scale: PrintScale => add(|_| PrintScale),
}
