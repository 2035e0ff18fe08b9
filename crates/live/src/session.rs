//! A live session: which frames are kept, and what is wanted next.

use std::path::Path;
use std::sync::Arc;

use depthcal_calibration::plan::BoardView;
use depthcal_detect::{DetectOptions, detect};
use depthcal_io::{GrayImage, MarkerObservation};
use depthcal_model::{Pattern, Target};
use rayon::prelude::*;

use crate::arrival::Arrival;
use crate::choice::{Judge, Judgement, differ};
use crate::error::LiveError;
use crate::fit::{FitJob, FitOutcome, FitSummary, KeptFrame};
use crate::guide::Guide;
use crate::page_state::{BoardSeen, KeptDot, PageState, Wanted};
use crate::recorder::Recorder;
use crate::sharpness::edge_width_px;

/// Columns and rows of the grid over the image in which markers are counted.
const GRID: [usize; 2] = [8, 6];
/// Fewest frames for the first fit, after which poses are planned: a camera from fewer leads to places that are hard to reach.
const FIRST_FIT: usize = 5;
/// Most frames that are kept: depth images of all of them are in memory.
const MOST_KEPT: usize = 300;

/// The outcome of a look at a frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Seen {
    /// Number of markers that were found.
    pub markers: usize,
    /// The name under which it was kept.
    pub kept: Option<String>,
}

/// The frame that is shown.
#[derive(Debug, Clone)]
struct Shown {
    arrival: Arc<Arrival>,
    markers: Vec<MarkerObservation>,
    judgement: Judgement,
    views: Vec<BoardView>,
    /// The name under which it is kept.
    kept_as: Option<String>,
}

/// A live session. Frames that it keeps are written at once.
#[derive(Debug)]
pub struct Session {
    target: Target,
    detect: DetectOptions,
    recorder: Recorder,
    judge: Judge,
    kept: Vec<KeptFrame>,
    /// Their views under the guide's camera, which take time to find.
    dots: Vec<Option<KeptDot>>,
    size: Option<[usize; 2]>,
    unit_mm: Option<f64>,
    guide: Option<Guide>,
    shown: Option<Shown>,
    fit: Option<FitSummary>,
    unfitted: Option<String>,
    pictures: u64,
    events: u64,
    message: String,
}

impl Session {
    /// A session that keeps frames in a folder, and begins with those that it has.
    ///
    /// # Errors
    /// Those of [`Recorder::open`]; [`LiveError::Detect`] where the board cannot be searched; [`LiveError::OtherDataset`] for
    /// several boards.
    pub fn open(folder: &Path, target: &Target, options: DetectOptions) -> Result<Self, LiveError> {
        if matches!(target.pattern, Pattern::Several { .. }) {
            let problem = "several boards cannot be guided at once".to_owned();
            return Err(LiveError::OtherDataset { path: folder.to_owned(), problem });
        }
        // An impossible board is an error before the first frame comes.
        let blank = GrayImage { width: 64, height: 64, data: vec![0; 64 * 64], bits: 8 };
        detect(&blank, target, &options)?;
        let (recorder, earlier) = Recorder::open(folder, target)?;
        let mut session = Self {
            target: target.clone(),
            detect: options,
            recorder,
            judge: Judge::default(),
            kept: Vec::new(),
            dots: Vec::new(),
            size: None,
            unit_mm: None,
            guide: None,
            shown: None,
            fit: None,
            unfitted: None,
            pictures: 0,
            events: 0,
            message: String::new(),
        };
        let markers_of_frames: Vec<_> = earlier.par_iter().map(|arrival| session.markers_in(&arrival.image)).collect();
        for (arrival, markers) in earlier.into_iter().zip(markers_of_frames) {
            session.begin_with(&arrival);
            session.kept.push(KeptFrame {
                name: arrival.name,
                markers: markers?,
                depth: arrival.depth.map(Arc::new),
                metadata: arrival.metadata,
            });
        }
        session.find_dots();
        if !session.kept.is_empty() {
            session.message = format!("{} frames of an earlier session", session.kept.len());
        }
        Ok(session)
    }

    /// The folder of the dataset.
    pub fn folder(&self) -> &Path {
        self.recorder.folder()
    }

    /// Names of the kept frames.
    pub fn kept(&self) -> Vec<String> {
        self.kept.iter().map(|frame| frame.name.clone()).collect()
    }

    /// Size, unit and first poses are those of the first frame.
    fn begin_with(&mut self, arrival: &Arrival) {
        let size = [arrival.image.width, arrival.image.height];
        if self.size != Some(size) && self.kept.is_empty() {
            (self.size, self.unit_mm) = (Some(size), arrival.unit_mm);
            self.guide = Some(Guide::starting(&self.target, size));
        }
    }

    fn diagonal(&self) -> f64 {
        self.size.map_or(1.0, |[width, height]| (width as f64).hypot(height as f64))
    }

    /// The markers of the board in an image; none where it is not there.
    fn markers_in(&self, image: &GrayImage) -> Result<Vec<MarkerObservation>, LiveError> {
        let detection = detect(image, &self.target, &self.detect)?;
        let markers = detection.map(|detection| detection.markers).unwrap_or_default();
        Ok(markers.into_iter().map(|m| MarkerObservation { index: m.index, pixel: m.pixel, std_px: 1.0 }).collect())
    }

    /// Looks at a frame, and keeps it if it is worth it.
    ///
    /// # Errors
    /// [`LiveError::Detect`] where the search fails, not where there is no board. A frame that cannot be written is no error:
    /// the message says so, and the session goes on.
    pub fn see(&mut self, arrival: Arrival) -> Result<Seen, LiveError> {
        self.begin_with(&arrival);
        let markers = self.markers_in(&arrival.image)?;
        let width = edge_width_px(&arrival.image, &self.target, &markers);
        let judgement = self.judge.judge(&markers, width, self.diagonal(), arrival.is_video);
        let views = self.guide.as_ref().map(|guide| guide.views(&markers)).unwrap_or_default();
        let is_wanted = self.is_worth_keeping(&markers, judgement, &views, arrival.is_video);
        let count = markers.len();
        self.pictures += 1;
        self.shown = Some(Shown { arrival: Arc::new(arrival), markers, judgement, views, kept_as: None });
        let name = if is_wanted { self.keep() } else { None };
        Ok(Seen { markers: count, kept: name })
    }

    /// Once poses are planned, a video keeps the planned ones alone: the frames on the way there are worth less.
    fn is_worth_keeping(
        &self,
        markers: &[MarkerObservation],
        Judgement { is_sharp, is_still }: Judgement,
        views: &[BoardView],
        is_video: bool,
    ) -> bool {
        let Some(guide) = &self.guide else { return false };
        if markers.is_empty() || !is_sharp || !is_still {
            return false;
        }
        let differs = |frame: &KeptFrame| differ(markers, &frame.markers, self.diagonal());
        if is_video && guide.is_fitted && !guide.wanted.is_empty() {
            // A pose may be wanted again, but not from a board that has not moved since.
            let is_reached = guide.distance_and_hint(views).is_some_and(|(distance, _)| distance <= 1.0);
            return is_reached && self.kept.last().is_none_or(differs);
        }
        self.kept.iter().all(differs)
    }

    /// Keeps the frame that is shown, whether it is sharp or not; returns its name.
    pub fn capture(&mut self) -> Option<String> {
        match &self.shown {
            None => self.message = "there is no frame yet".to_owned(),
            Some(shown) if shown.kept_as.is_some() => self.message = "this frame is kept already".to_owned(),
            Some(shown) if shown.markers.is_empty() => {
                self.message = "not kept: the board is not seen".to_owned();
            }
            Some(_) => return self.keep(),
        }
        None
    }

    fn keep(&mut self) -> Option<String> {
        let shown = self.shown.as_mut()?;
        let arrival = shown.arrival.clone();
        if self.kept.len() >= MOST_KEPT {
            self.message = format!("not kept: {MOST_KEPT} frames are the most");
            return None;
        }
        if let Some(problem) = self.recorder.refusal(&arrival) {
            self.message = format!("not kept: {problem}");
            return None;
        }
        let name = match self.recorder.keep(&arrival) {
            Ok(name) => name,
            Err(error) => {
                self.message = format!("not kept: {error}");
                return None;
            }
        };
        shown.kept_as = Some(name.clone());
        self.unit_mm = arrival.unit_mm;
        self.kept.push(KeptFrame {
            name: name.clone(),
            markers: shown.markers.clone(),
            depth: arrival.depth.clone().map(Arc::new),
            metadata: arrival.metadata.clone(),
        });
        if let Some(guide) = &mut self.guide
            && guide.distance_and_hint(&shown.views).is_some_and(|(distance, _)| distance <= 1.0)
        {
            guide.wanted.pop_front();
        }
        let dot = self.kept.last().and_then(|frame| self.dot(frame));
        self.dots.push(dot);
        self.events += 1;
        self.message = format!("kept {name}");
        Some(name)
    }

    /// Removes the frame that was kept last; returns its name.
    pub fn take_back(&mut self) -> Option<String> {
        let Some(last) = self.kept.last().map(|frame| frame.name.clone()) else {
            self.message = "there is no frame to take back".to_owned();
            return None;
        };
        if let Err(error) = self.recorder.take_back(&last) {
            self.message = format!("not taken back: {error}");
            return None;
        }
        self.kept.pop();
        self.dots.pop();
        if let Some(shown) = self.shown.as_mut().filter(|shown| shown.kept_as.as_ref() == Some(&last)) {
            shown.kept_as = None;
        }
        self.events += 1;
        self.message = format!("taken back {last}");
        Some(last)
    }

    /// Gives up the pose that is wanted, for the next one.
    pub fn skip(&mut self) {
        let skipped = self.guide.as_mut().and_then(|guide| guide.wanted.pop_front());
        self.message = match skipped {
            Some(wanted) => format!("not wanted any more: {}", wanted.words),
            None => "no pose is wanted".to_owned(),
        };
    }

    /// Shows a message.
    pub fn tell(&mut self, message: String) {
        self.message = message;
    }

    /// Number of frames that were kept or taken back.
    pub fn changes(&self) -> u64 {
        self.events
    }

    /// The frames to fit; `None` while they are too few.
    pub fn fit_job(&self) -> Option<FitJob> {
        let size = self.size?;
        let frames: Vec<KeptFrame> = self.kept.iter().filter(|frame| !frame.markers.is_empty()).cloned().collect();
        let job = FitJob { frames, target: self.target.clone(), size, unit_mm: self.unit_mm };
        (job.frames.len() >= FIRST_FIT).then_some(job)
    }

    /// Takes over a fit.
    pub fn fitted(&mut self, outcome: FitOutcome) {
        match outcome.result {
            Ok(fitted) => {
                // Of the first poses those that are left come after the planned ones, or where nothing can be planned.
                let left = self.guide.take().map(|guide| guide.wanted).unwrap_or_default();
                let mut guide = Guide::fitted(&self.target, fitted.camera, &fitted.poses);
                if guide.wanted.is_empty() {
                    guide.is_fitted = false;
                    guide.wanted = left;
                }
                if let Some(shown) = &mut self.shown {
                    shown.views = guide.views(&shown.markers);
                }
                self.guide = Some(guide);
                self.find_dots();
                (self.fit, self.unfitted) = (Some(fitted.summary), None);
            }
            Err(reason) => self.unfitted = Some(reason),
        }
    }

    /// The frame that is shown.
    pub fn shown(&self) -> Option<Arc<Arrival>> {
        self.shown.as_ref().map(|shown| shown.arrival.clone())
    }

    /// The state for the page.
    pub fn page_state(&self) -> PageState {
        let board = self.shown.as_ref().filter(|shown| !shown.markers.is_empty()).map(|shown| BoardSeen {
            markers: shown.markers.iter().map(|marker| marker.pixel).collect(),
            is_sharp: shown.judgement.is_sharp,
            is_still: shown.judgement.is_still,
        });
        let wanted = self.guide.as_ref().and_then(|guide| {
            let wanted = guide.wanted.front()?;
            let views = self.shown.as_ref().map_or(&[][..], |shown| &shown.views);
            let there = guide.distance_and_hint(views);
            let is_reached = there.is_some_and(|(distance, _)| distance <= 1.0);
            Some(Wanted {
                outline: guide.outline(&wanted.pose),
                words: wanted.words.clone(),
                is_reached,
                hint: there.filter(|_| !is_reached).map(|(_, hint)| hint.to_owned()),
            })
        });
        PageState {
            picture: self.pictures,
            size: self.size.unwrap_or_default(),
            board,
            wanted,
            count: self.kept.len(),
            kept: self.dots.iter().flatten().cloned().collect(),
            grid: GRID,
            cells: self.cells(),
            fit: self.fit.clone(),
            unfitted: self.unfitted.clone(),
            events: self.events,
            message: self.message.clone(),
            ..PageState::default()
        }
    }

    /// Distance and tilt of the kept frames under the present camera.
    fn find_dots(&mut self) {
        self.dots = self.kept.par_iter().map(|frame| self.dot(frame)).collect();
    }

    fn dot(&self, frame: &KeptFrame) -> Option<KeptDot> {
        let view = self.guide.as_ref()?.views(&frame.markers).into_iter().next()?;
        Some(KeptDot {
            name: frame.name.clone(),
            distance_mm: view.distance_mm,
            tilt_deg: view.tilt_deg(),
            turn_deg: view.turn_deg,
        })
    }

    /// Markers of kept frames in every cell of the grid.
    fn cells(&self) -> Vec<u32> {
        let mut cells = vec![0; GRID[0] * GRID[1]];
        let Some(size) = self.size else { return cells };
        for [u, v] in self.kept.iter().flat_map(|frame| &frame.markers).map(|marker| marker.pixel) {
            let place =
                |x: f64, i: usize| (((x + 0.5).max(0.0) / size[i] as f64 * GRID[i] as f64) as usize).min(GRID[i] - 1);
            cells[place(v, 1) * GRID[0] + place(u, 0)] += 1;
        }
        cells
    }
}
