//! The cases: faults of captures, and how much of a capture has them.

/// A fault of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Spoiled {
    /// It shows a board of the same pattern that is 18 % larger.
    WrongBoard,
    /// A reflection on the board.
    Glare,
    /// The image of a board that moves by 9 px.
    MotionBlur,
    /// An exposure three times as long.
    Saturation,
    /// The board reaches beyond the image.
    PartlyOutside,
    /// The depth of another frame.
    SwappedDepth,
    /// Rows are exposed one after the other while the board moves by 6 px.
    RollingExposure,
}

/// A wrong statement of `dataset.toml`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Declared {
    /// Spacing times a factor.
    Spacing(f64),
    /// Diameter of the dots times a factor.
    Diameter(f64),
    /// Unit of depth times a factor.
    Unit(f64),
    /// Another kind of board.
    Kind,
    /// Start values of focal lengths and principal point times a factor.
    Start(f64),
}

/// A fault of a capture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fault {
    Nothing,
    /// A share of the frames.
    Frames(Spoiled, f64),
    /// A share of the markers is off by 2 to 20 px.
    Markers(f64),
    /// A share of the depth pixels is anything between 0.3 and 3 m.
    Depth(f64),
    /// A share of the depth pixels has no value.
    Holes(f64),
    Declared(Declared),
    /// All images are mirrored.
    Mirrored,
}

/// A row of the table.
#[derive(Debug, Clone)]
pub struct Case {
    pub name: String,
    pub fault: Fault,
}

impl Case {
    /// The capture as it is.
    pub fn nothing() -> Self {
        Self { name: "nothing".to_owned(), fault: Fault::Nothing }
    }
}

/// All rows.
pub fn cases() -> Vec<Case> {
    let mut cases = vec![Case::nothing()];
    let mut add = |name: String, fault: Fault| cases.push(Case { name, fault });
    for (name, spoiled) in [
        ("wrong board", Spoiled::WrongBoard),
        ("glare", Spoiled::Glare),
        ("motion blur", Spoiled::MotionBlur),
        ("saturation", Spoiled::Saturation),
        ("board partly outside", Spoiled::PartlyOutside),
        ("swapped depth", Spoiled::SwappedDepth),
        ("rolling exposure", Spoiled::RollingExposure),
    ] {
        for percent in [10, 20, 40] {
            add(format!("{name}, {percent} % of the frames"), Fault::Frames(spoiled, 0.01 * f64::from(percent)));
        }
    }
    for percent in [10, 30] {
        let share = 0.01 * f64::from(percent);
        add(format!("markers off by 2 to 20 px, {percent} %"), Fault::Markers(share));
        add(format!("depth at random, {percent} % of the pixels"), Fault::Depth(share));
    }
    for percent in [30, 60] {
        add(format!("holes, {percent} % of the pixels"), Fault::Holes(0.01 * f64::from(percent)));
    }
    for (name, declared) in [
        ("start values 30 % too large", Declared::Start(1.3)),
        ("start values 30 % too small", Declared::Start(0.7)),
        ("declared spacing 3 % too large", Declared::Spacing(1.03)),
        ("declared spacing 10 % too large", Declared::Spacing(1.1)),
        ("declared diameter half of the true one", Declared::Diameter(0.5)),
        ("declared diameter 20 % too large", Declared::Diameter(1.2)),
        ("declared unit 10 % too large", Declared::Unit(1.1)),
        ("declared unit ten times the true one", Declared::Unit(10.0)),
        ("declared kind of board", Declared::Kind),
    ] {
        add(name.to_owned(), Fault::Declared(declared));
    }
    add("mirrored images".to_owned(), Fault::Mirrored);
    cases
}
