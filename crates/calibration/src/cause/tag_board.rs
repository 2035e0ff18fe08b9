//! The board of tags that the images show: dictionary, first tag, columns and rows, and the side of the tags follow from the tags
//! themselves.

use depthcal_detect::{Homography, SeenTag, survey_tags, tag_square};
use depthcal_io::GrayImage;
use depthcal_model::{Pattern, Target};
use depthcal_statistics::upper_median;
use rayon::prelude::*;

use super::board_alternative::{Alternative, numbered};
use super::board_fault::BoardFault;

/// Fewest tags in the image with most of them that make a board.
const FEWEST_TAGS: usize = 4;
/// A dictionary with so many times the tags of another leaves it out: what is no tag, or a mirrored one, may be read as one.
const LEAD: usize = 2;
/// Most columns of a board that are tried.
const MOST_COLUMNS: usize = 40;
/// A tag is where a layout has it within this share of its diagonal.
const PLACED: f64 = 0.25;
/// Share of the tags that have to be in their place.
const AGREEING: f64 = 0.8;
/// By how much a tag's share of the spacing may differ from the declaration.
const SHARE_TOLERANCE: f64 = 0.04;

/// The tags of the dictionary and of the side, mirrored or not, that most images agree on.
struct Seen {
    dictionary: &'static str,
    is_mirrored: bool,
    /// By image.
    tags: Vec<Vec<SeenTag>>,
}

/// A board of tags as declared.
struct Declared {
    board: Target,
    first_tag: usize,
    marker_mm: f64,
    dictionary: String,
}

/// A layout of tags: columns, the column of the first white square of a ChArUco board, and the number of the first tag.
#[derive(Clone, Copy, PartialEq)]
struct Layout {
    is_charuco: bool,
    columns: usize,
    first_white: usize,
    first_tag: usize,
}

/// The board that the tags of the images make.
pub(super) fn tag_board(declared: &Target, images: &[GrayImage]) -> Vec<Alternative> {
    let parts = declared.parts();
    let [part] = parts.as_slice() else { return Vec::new() };
    let (marker_mm, dictionary) = match &part.board.pattern {
        Pattern::Charuco { marker_mm, dictionary } => (*marker_mm, dictionary.clone()),
        Pattern::Aprilgrid { marker_mm } => (*marker_mm, "DICT_APRILTAG_36h11".to_owned()),
        _ => return most_seen(images).iter().flat_map(|seen| other_kind(seen, part.board)).collect(),
    };
    let declared = Declared { board: part.board.clone(), first_tag: part.first_tag, marker_mm, dictionary };
    let of_seen = |seen: &Seen| layout_of(seen, &declared).and_then(|layout| alternative(seen, &declared, layout));
    most_seen(images).iter().filter_map(of_seen).collect()
}

/// The tags that most images agree on, those of the most frequent dictionary first; others only where they are nearly as many.
fn most_seen(images: &[GrayImage]) -> Vec<Seen> {
    let surveys: Vec<_> = images.par_iter().map(survey_tags).collect();
    let mut all: Vec<Seen> = Vec::new();
    for (image, survey) in surveys.into_iter().enumerate() {
        for seen in survey {
            let same = |other: &&mut Seen| other.dictionary == seen.dictionary && other.is_mirrored == seen.is_mirrored;
            match all.iter_mut().find(same) {
                Some(other) => other.tags[image] = seen.tags,
                None => {
                    let mut tags = vec![Vec::new(); images.len()];
                    tags[image] = seen.tags;
                    all.push(Seen { dictionary: seen.dictionary, is_mirrored: seen.is_mirrored, tags });
                }
            }
        }
    }
    let count = |seen: &Seen| seen.tags.iter().map(Vec::len).sum::<usize>();
    all.sort_by_key(|seen| std::cmp::Reverse(count(seen)));
    let most = all.first().map_or(0, count);
    all.retain(|seen| LEAD * count(seen) > most && seen.tags.iter().any(|tags| tags.len() >= FEWEST_TAGS));
    all
}

/// A board of tags where one without is declared.
fn other_kind(seen: &Seen, declared: &Target) -> Vec<Alternative> {
    let kinds = [
        ("charuco", Pattern::Charuco { marker_mm: 0.7 * declared.spacing_mm, dictionary: seen.dictionary.to_owned() }),
        ("aprilgrid", Pattern::Aprilgrid { marker_mm: 0.7 * declared.spacing_mm }),
    ];
    let alternatives = kinds.into_iter().filter_map(|(kind, pattern)| {
        // A ChArUco board counts squares.
        let more = usize::from(kind == "charuco");
        let board =
            Target { pattern, columns: declared.columns + more, rows: declared.rows + more, ..declared.clone() };
        let dictionary = if kind == "charuco" { seen.dictionary } else { "DICT_APRILTAG_36h11" };
        let marker_mm = 0.7 * declared.spacing_mm;
        let guess = Declared { board, first_tag: 0, marker_mm, dictionary: dictionary.to_owned() };
        let layout = layout_of(seen, &guess)?;
        let mut alternative = alternative(seen, &guess, layout)?;
        let evidence = format!("the images show tags of {}", seen.dictionary);
        alternative.faults.insert(0, BoardFault::Kind { kind, evidence });
        Some(alternative)
    });
    alternatives.collect()
}

/// The layout in which most tags are in their place; one that is declared before others that fit alike.
fn layout_of(seen: &Seen, declared: &Declared) -> Option<Layout> {
    let is_charuco = matches!(declared.board.pattern, Pattern::Charuco { .. });
    let lowest = seen.tags.iter().flatten().map(|tag| tag.id).min()?;
    let firsts = [declared.first_tag, lowest];
    let first_whites = if is_charuco { [1, 0] } else { [0, 0] };
    let columns = std::iter::once(declared.board.columns).chain(2..=MOST_COLUMNS);
    let layouts = columns.flat_map(|columns| {
        firsts.into_iter().flat_map(move |first_tag| {
            first_whites.map(|first_white| Layout { is_charuco, columns, first_white, first_tag })
        })
    });
    let scored = layouts.map(|layout| (agreement(seen, layout), layout));
    // The first of several with the same score.
    let best = scored.fold(None, |best: Option<(f64, Layout)>, next| match best {
        Some(best) if best.0 >= next.0 - 0.02 => Some(best),
        _ => Some(next),
    });
    best.filter(|(share, _)| *share >= AGREEING).map(|(_, layout)| layout)
}

/// The share of the tags, of images with enough of them, that are where a layout has them.
fn agreement(seen: &Seen, layout: Layout) -> f64 {
    let (mut placed, mut all) = (0, 0);
    for tags in seen.tags.iter().filter(|tags| tags.len() >= FEWEST_TAGS) {
        all += tags.len();
        let mut pairs: Vec<_> = tags.iter().filter_map(|tag| Some((layout.place(tag.id)?, tag))).collect();
        // Twice, the second time without those that are far off.
        for _ in 0..2 {
            let centres: Vec<_> = pairs.iter().map(|(place, tag)| (*place, centre(tag))).collect();
            let Some(map) = (centres.len() >= FEWEST_TAGS).then(|| Homography::fit(&centres)).flatten() else {
                pairs.clear();
                break;
            };
            pairs.retain(|(place, tag)| {
                let (seen_at, diagonal) = (centre(tag), distance(tag.corners[0], tag.corners[2]));
                map.apply(*place).is_some_and(|p| distance(p, seen_at) < PLACED * diagonal)
            });
        }
        placed += pairs.len();
    }
    placed as f64 / all.max(1) as f64
}

impl Layout {
    /// Column and row of a tag; `None` where the board has none of its number.
    fn place(self, id: usize) -> Option<[f64; 2]> {
        let id = id.checked_sub(self.first_tag)?;
        let [column, row] = match self.is_charuco {
            // More rows than any board has.
            true => tag_square(id, self.columns, 4 * MOST_COLUMNS, self.first_white)?,
            false => [id % self.columns, id / self.columns],
        };
        Some([column as f64, row as f64])
    }
}

fn centre(tag: &SeenTag) -> [f64; 2] {
    [0, 1].map(|axis| tag.corners.iter().map(|corner| corner[axis]).sum::<f64>() / 4.0)
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// The board of a layout with its faults; `None` where it has none.
fn alternative(seen: &Seen, declared: &Declared, layout: Layout) -> Option<Alternative> {
    let Declared { board, first_tag, marker_mm, dictionary } = declared;
    let mut faults = Vec::new();
    if seen.is_mirrored {
        faults.push(BoardFault::Mirrored);
    }
    let ids = || seen.tags.iter().flatten().map(|tag| tag.id).filter(|id| layout.place(*id).is_some());
    let (lowest, highest) = (ids().min()?, ids().max()?);
    let mut mended = board.clone();
    let smallest = smallest(seen.dictionary, highest);
    if layout.is_charuco && family(dictionary) != family(seen.dictionary) {
        faults.push(BoardFault::Dictionary { dictionary: smallest.clone() });
    }
    if layout.first_tag != *first_tag {
        faults.push(BoardFault::FirstTag { seen: [lowest, highest] });
    }
    let last_row = layout.place(highest).map_or(0, |[_, row]| row as usize);
    let (columns, rows) = (board.columns, board.rows);
    let sizes = [
        ([columns, rows], ""),
        ([rows, columns], "columns and rows are exchanged"),
        ([columns + 1, rows + 1], "squares are counted, not inner corners"),
        ([rows + 1, columns + 1], "squares are counted, and columns and rows are exchanged"),
        ([columns.saturating_sub(1), rows.saturating_sub(1)], "counted in the images"),
    ];
    let fits = |[c, r]: [usize; 2]| c == layout.columns && r > last_row;
    let measured = ([layout.columns, last_row + 1], "from the numbers of the tags that were seen");
    let ends_there = |([c, r], _): &([usize; 2], &str)| *c == layout.columns && *r == last_row + 1;
    // Rows may be hidden of the declared board; of another one a size that the tags fill is more likely than a larger one.
    let [declared, ref others @ ..] = sizes;
    let other = others.iter().find(|size| ends_there(size)).or_else(|| others.iter().find(|(size, _)| fits(*size)));
    let chosen = if fits(declared.0) { Some(&declared) } else { other };
    let ([columns, rows], explanation) = *chosen.unwrap_or(&measured);
    if !explanation.is_empty() {
        faults.push(BoardFault::Size { columns, rows, explanation });
    }
    (mended.columns, mended.rows) = (columns, rows);
    let share = measured_share(seen, layout)?;
    let is_other_share = (share / (marker_mm / board.spacing_mm) - 1.0).abs() > SHARE_TOLERANCE;
    let side_mm = if is_other_share { share * board.spacing_mm } else { *marker_mm };
    if is_other_share {
        faults.push(BoardFault::MarkerSide { share, marker_mm: side_mm });
    }
    mended.pattern = match layout.is_charuco {
        true => Pattern::Charuco { marker_mm: side_mm, dictionary: smallest },
        false => Pattern::Aprilgrid { marker_mm: side_mm },
    };
    let target = numbered(mended, layout.first_tag);
    (!faults.is_empty()).then_some(Alternative { target, is_mirrored: seen.is_mirrored, faults })
}

/// Side of a tag per spacing: in a tag's own plane coordinates, the distance of a neighbour by the distance in the layout.
fn measured_share(seen: &Seen, layout: Layout) -> Option<f64> {
    let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let mut shares = Vec::new();
    for tags in &seen.tags {
        let placed: Vec<_> = tags.iter().filter_map(|tag| Some((layout.place(tag.id)?, tag))).collect();
        for (place, tag) in &placed {
            let pairs: Vec<_> = tag.corners.into_iter().zip(square).collect();
            let Some(map) = Homography::fit(&pairs) else { continue };
            for (other_place, other) in &placed {
                let steps = distance(*place, *other_place);
                if (0.5..1.6).contains(&steps) {
                    let sides = map.apply(centre(other)).map(|p| distance(p, [0.5, 0.5]));
                    shares.extend(sides.map(|sides| steps / sides));
                }
            }
        }
    }
    upper_median(&mut shares)
}

/// The dictionaries of one kind are the first tags of the largest.
fn family(dictionary: &str) -> String {
    let bare = dictionary.to_uppercase().trim_start_matches("DICT_").to_owned();
    match bare.rsplit_once('_') {
        Some((cells, count)) if count.chars().all(|c| c.is_ascii_digit()) => cells.to_owned(),
        _ => bare,
    }
}

/// The smallest dictionary of a kind that has a tag.
fn smallest(largest: &str, id: usize) -> String {
    let counts = [50, 100, 250, 1000];
    match largest.strip_suffix("_1000") {
        Some(cells) => format!("{cells}_{}", counts.into_iter().find(|count| id < *count).unwrap_or(1000)),
        None => largest.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dictionaries_are_told_by_their_cells() {
        assert_eq!(
            (smallest("DICT_5X5_1000", 49), smallest("DICT_5X5_1000", 120)),
            ("DICT_5X5_50".into(), "DICT_5X5_250".into())
        );
        assert_eq!(smallest("DICT_APRILTAG_36h11", 7), "DICT_APRILTAG_36h11");
        assert!(family("dict_5x5_50") == family("DICT_5X5_1000") && family("5X5_50") != family("DICT_4X4_50"));
        assert!(family("DICT_APRILTAG_36h11") != family("DICT_APRILTAG_36h10"));
    }

    /// Tags in the place of a board of seven columns whose first tag is 20.
    #[test]
    fn columns_and_first_tag_follow_from_the_places_of_tags() {
        let truth = Layout { is_charuco: true, columns: 7, first_white: 1, first_tag: 20 };
        let view = |[x, y]: [f64; 2]| {
            let depth = 1.0 + 0.02 * x + 0.01 * y;
            [(40.0 * x + 3.0 * y) / depth, (2.0 * x + 38.0 * y) / depth]
        };
        let tag = |id: usize| {
            let [column, row] = truth.place(id).expect("on the board");
            let corners = [[0.2, 0.2], [0.8, 0.2], [0.8, 0.8], [0.2, 0.8]].map(|[x, y]| view([column + x, row + y]));
            SeenTag { id, corners }
        };
        let seen = Seen { dictionary: "DICT_5X5_1000", is_mirrored: false, tags: vec![(20..37).map(tag).collect()] };
        let pattern = Pattern::Charuco { marker_mm: 18.0, dictionary: "DICT_4X4_50".into() };
        let board = Target { pattern, columns: 5, rows: 7, spacing_mm: 30.0 };
        let declared = Declared { board, first_tag: 0, marker_mm: 18.0, dictionary: "DICT_4X4_50".into() };
        let layout = layout_of(&seen, &declared).expect("a layout");
        assert_eq!((layout.columns, layout.first_white, layout.first_tag), (7, 1, 20));
        let faults = alternative(&seen, &declared, layout).expect("faults").faults;
        let dictionary = BoardFault::Dictionary { dictionary: "DICT_5X5_50".into() };
        let first_tag = BoardFault::FirstTag { seen: [20, 36] };
        let size = BoardFault::Size { columns: 7, rows: 5, explanation: "columns and rows are exchanged" };
        assert_eq!(faults, [dictionary, first_tag, size]);
    }

    /// Tags fill eight columns and six rows; nine and seven are declared, and exchanged without the border there would be ten.
    #[test]
    fn rows_that_tags_fill_are_more_likely_than_hidden_ones() {
        let truth = Layout { is_charuco: true, columns: 8, first_white: 1, first_tag: 0 };
        let tag = |id: usize| {
            let [column, row] = truth.place(id)?;
            let corners = [[0.15, 0.15], [0.85, 0.15], [0.85, 0.85], [0.15, 0.85]]
                .map(|[x, y]| [40.0 * (column + x), 40.0 * (row + y)]);
            Some(SeenTag { id, corners })
        };
        let seen =
            Seen { dictionary: "DICT_4X4_1000", is_mirrored: false, tags: vec![(0..24).filter_map(tag).collect()] };
        let pattern = Pattern::Charuco { marker_mm: 21.0, dictionary: "DICT_4X4_50".into() };
        let board = Target { pattern, columns: 9, rows: 7, spacing_mm: 30.0 };
        let declared = Declared { board, first_tag: 0, marker_mm: 21.0, dictionary: "DICT_4X4_50".into() };
        let faults = alternative(&seen, &declared, truth).expect("faults").faults;
        assert_eq!(faults, [BoardFault::Size { columns: 8, rows: 6, explanation: "counted in the images" }]);
    }
}
