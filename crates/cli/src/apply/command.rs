//! `apply`: corrects depth images.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use clap::Args;
use depthcal_calibration::camera_record::unnamed_camera;
use depthcal_calibration::depth_uncertainty::uncertain_depth;
use depthcal_calibration::observe::PlacedCamera;
use depthcal_correction::{CorrectionSummary, Corrector, CorrectorError, FrameContext};
use depthcal_io::{
    Calibration, CameraRecord, Cloud, DATASET_FILE, DEPTH_EXTENSIONS, Dataset, Disparity, GrayImage, RgbImage,
    check_writable, write_depth_frame,
};
use depthcal_model::{Camera, Quantities};
use depthcal_report::format::count;
use rayon::prelude::*;
use serde_json::{Value, json};

use super::images::{by_stem, images_in, read_color, stem};
use super::job::Job;
use super::reach::{Beyond, Reach};
use super::register::{RigRegister, register};
use super::resume::Resume;
use super::stream::StreamContext;
use super::stream_args::StreamArgs;
use super::stream_register::Registered;
use super::written::{Written, millimetres, points_of};
use crate::common::{above_zero, calibration_path, print_pairing, read_calibration, read_cameras};
use crate::failure::{Failure, input};
use crate::progress::Progress;
use crate::session::Session;
use crate::voice::{complaint, is_json, say};

/// Corrects depth images with a calibration.
///
/// Corrected images have the names, sizes and units of their originals. All input is read once before anything is written,
/// so that a damaged image is reported at once.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  depthcal apply result/calibration.json depth/ --out corrected/
  depthcal apply result/calibration.json depth/ --out corrected/ --cloud --image ir/
  depthcal apply result/calibration.json captures/ --out corrected/    a dataset: unit, images and times as in dataset.toml
  depthcal apply result/calibration.json raw/0001.png --unit-mm 0.1 --out corrected/
  depthcal apply result/calibration.json depth/ --out corrected/ --uncertainty --mask    how certain, and where supported
  depthcal apply rig/calibration.json captures/ --register colour --cloud --out registered/    several cameras
  driver | depthcal apply rig/calibration.json - --register colour --stream-output u16 > registered.raw    the same of a stream")]
pub(crate) struct Apply {
    /// A calibration.json, or the folder that it is in.
    #[arg(value_parser = calibration_path())]
    calibration: PathBuf,
    /// Depth images (16-bit PNG, TIFF, NPY, NPZ or PGM, floating-point TIFF, NPY, NPZ or EXR), folders of them, or datasets:
    /// folders with a dataset.toml, from which depth unit, images, times and temperatures of the frames are then taken. `-` alone
    /// reads raw frames from standard input and writes them, corrected, to standard output.
    #[arg(required = true)]
    depth: Vec<PathBuf>,
    /// Folder for the results; created if it does not exist [default: depthcal-out/apply]. An interrupted run continues where it
    /// ended.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    stream: StreamArgs,
    #[command(flatten)]
    written: Written,
    /// Millimetres per step of depth images, or per unit of floating-point ones (1000 for metres), outside datasets [default: as
    /// in the dataset that the calibration was fitted to].
    #[arg(long, value_name = "X")]
    unit_mm: Option<f64>,
    /// Infrared image of the depth image with the same name (without extension), or a folder of such images; may be given
    /// several times.
    #[arg(long, value_name = "PATH")]
    image: Vec<PathBuf>,
    /// Colour image on the pixel grid of the depth image with the same name (without extension), or a folder of such images:
    /// colours of the point cloud; may be given several times.
    #[arg(long, value_name = "PATH", requires = "cloud")]
    color: Vec<PathBuf>,
    /// Resamples the corrected depth of a rig's cameras into this camera's images, its colours onto their pixels, and writes
    /// clouds (--cloud) in the frame of the rig. DEPTH are then datasets of the rig.
    #[arg(long, value_name = "CAMERA", conflicts_with_all = ["image", "color", "unit_mm"])]
    register: Option<String>,
}

impl Apply {
    pub(crate) fn run(&self, session: &Session) -> Result<Value, Failure> {
        above_zero("--unit-mm", self.unit_mm, "the millimetres per step, such as 1 or 0.25")?;
        if self.stream.stream_output.is_some() && self.depth.iter().all(|path| path.as_os_str() != "-") {
            let message = "--stream-output is for frames from standard input: give `-` as DEPTH, or leave it out";
            return Err(Failure::Input(message.to_owned()));
        }
        let (calibration, camera) = read_calibration(&self.calibration, &session.register)?;
        if let Some(target) = &self.register {
            return self.run_register(&calibration, target, session);
        }
        if self.depth.iter().any(|path| path.as_os_str() == "-") {
            self.check_steps_of_stream(&calibration.camera)?;
            self.run_stream(&camera, self.unit_mm.or(calibration.camera.depth_unit_mm), None)?;
            return Ok(Value::Null);
        }
        let jobs = self.jobs(&calibration.camera)?;
        self.check_names(&jobs)?;
        let corrector = self.corrector(&calibration, &camera)?;
        warn_of_missing(&corrector, &jobs);
        let reach = Reach::of(&calibration, &named(&calibration, &camera));

        check_writable(self.folder()).map_err(input)?;
        let resume = Resume::open(self.folder(), &self.calibration, &self.written)?;
        let all = jobs.len();
        let (done, jobs): (Vec<Job>, Vec<Job>) =
            jobs.into_iter().partition(|job| resume.is_done(job, &self.outputs(job)));
        if jobs.len() < all {
            say!("{} of {} were complete already", all - jobs.len(), count(all, "frame"));
        }

        let progress = Progress::new("checking images", jobs.len());
        jobs.par_iter().try_for_each(|job| -> Result<(), Failure> {
            let (depth, _) = job.read(&corrector)?;
            progress.advance();
            reach.as_ref().map_or(Ok(()), |reach| reach.check_unit(&depth, job))
        })?;
        drop(progress);
        resume.begin(done.iter())?;
        let progress = Progress::new("correcting", jobs.len());
        let (summary, beyond) = jobs
            .par_iter()
            .map(|job| -> Result<_, Failure> {
                let of_job = self.correct(job, &corrector, reach.as_ref())?;
                resume.completed(job)?;
                progress.advance();
                Ok(of_job)
            })
            .try_reduce(Default::default, |a, b| Ok((a.0 + b.0, a.1 + b.1)))?;
        drop(progress);
        resume.end();
        if let Some(warning) = reach.and_then(|reach| reach.warning(beyond)) {
            complaint("warning", 0, format_args!("{warning}"));
        }
        self.print(jobs.len(), summary);
        let CorrectionSummary { corrected, saturated, invalid, not_correctable } = summary;
        let pixels = json!({
            "corrected": corrected, "saturated": saturated, "without_depth": invalid, "not_correctable": not_correctable,
            "nearer_than_boards": beyond.nearer, "farther_than_boards": beyond.farther,
        });
        Ok(
            json!({ "frames": jobs.len(), "complete_before": all - jobs.len(), "pixels": pixels, "written": [self.folder()] }),
        )
    }

    /// The corrector, with the uncertainty of its depth where that is asked for.
    fn corrector(&self, calibration: &Calibration, camera: &Camera) -> Result<Corrector, Failure> {
        let of_calibration = |error| Failure::Input(format!("{}: {error}", self.calibration.display()));
        let corrector = Corrector::new(camera).map_err(of_calibration)?;
        if !self.written.uncertainty.any() {
            return Ok(corrector);
        }
        let depth = uncertain_depth(calibration, &named(calibration, camera))
            .ok_or_else(|| of_calibration(CorrectorError::NoUncertainty))?;
        if !depth.has_covariance() {
            let message = format_args!(
                "the calibration has no covariance, so that the uncertainty is that of noise alone: calibrate again with \
                 --estimator joint"
            );
            complaint("warning", 0, message);
        }
        Ok(corrector.with_uncertainty(depth))
    }

    /// Frames of a rig, resampled into one of its cameras.
    fn run_register(&self, calibration: &Calibration, target: &str, session: &Session) -> Result<Value, Failure> {
        if calibration.others.is_empty() {
            return Err(Failure::Input(format!(
                "{}: --register needs the calibration of a rig, from a dataset with sections [cameras.NAME]",
                self.calibration.display()
            )));
        }
        let cameras = read_cameras(&self.calibration, calibration, &session.register)?;
        if self.depth.iter().any(|path| path.as_os_str() == "-") {
            let cameras = Registered::of(&cameras, calibration, self.stream.stream_camera.as_deref(), target)?;
            let depth = cameras.depth.camera.clone();
            let record = calibration.cameras().find(|camera| camera.name == cameras.depth.name);
            record.map_or(Ok(()), |record| self.check_steps_of_stream(record))?;
            self.run_stream(&depth, cameras.unit_mm, Some(cameras))?;
            return Ok(Value::Null);
        }
        let asked = RigRegister {
            calibration: &self.calibration,
            record: calibration,
            datasets: &self.depth,
            target,
            cloud: self.written.cloud,
            out: self.folder(),
        };
        register(&asked, session)
    }

    /// Raw frames from standard input to standard output.
    fn run_stream(&self, camera: &Camera, unit_mm: Option<f64>, register: Option<Registered>) -> Result<(), Failure> {
        if is_json() {
            return Err(Failure::Input("--json and `-` both want standard output: leave --json out".into()));
        }
        if self.depth.len() > 1
            || self.out.is_some()
            || self.written.cloud.is_some()
            || !self.image.is_empty()
            || self.written.uncertainty.any()
        {
            return Err(Failure::Input(
                "`-` reads raw frames and writes raw frames to standard output: give it as the only DEPTH, without \
                 --out, --cloud, --image, --uncertainty and --mask"
                    .into(),
            ));
        }
        let corrector = Corrector::new(camera)
            .map_err(|error| Failure::Input(format!("{}: {error}", self.calibration.display())))?;
        self.stream.run(StreamContext { corrector: &corrector, unit_mm, calibration: &self.calibration, register })
    }

    /// Refuses a stream of whole steps for a camera whose files hold disparities: they may be disparities, or depth.
    fn check_steps_of_stream(&self, camera: &CameraRecord) -> Result<(), Failure> {
        match camera.disparity {
            Some(_) if self.stream.takes_steps() => Err(Failure::Input(format!(
                "{}: this camera's files hold disparities, which a stream of u16 does not convert: make depth of them and give \
                 --stream-input f32, in mm",
                self.calibration.display()
            ))),
            _ => Ok(()),
        }
    }

    /// How the values of bare files become depth: the millimetres of a step, and the function of disparities.
    fn meaning_of_files(&self, path: &Path, camera: &CameraRecord) -> Result<(f64, Option<Disparity>), Failure> {
        if let Some(Disparity([a, b])) = camera.disparity {
            return match self.unit_mm {
                None => Ok((1.0, camera.disparity)),
                Some(_) => Err(Failure::Input(format!(
                    "{}: this camera's files hold disparities d, and become depth by 1/z = {a} + {b} d: leave --unit-mm out; depth \
                     that was made of them elsewhere needs a dataset.toml with depth.unit_mm",
                    self.calibration.display()
                ))),
            };
        }
        let unit_mm = self.unit_mm.or(camera.depth_unit_mm).ok_or_else(|| {
            Failure::Input(format!(
                "{}: the depth unit is unknown: {} does not record it; give --unit-mm, the millimetres per step of these images",
                path.display(),
                self.calibration.display()
            ))
        })?;
        Ok((unit_mm, None))
    }

    /// Refuses to write depth that was made of disparities to files of whole numbers.
    fn check_fractions<'a>(&self, what: &Path, mut depth: impl Iterator<Item = &'a Path>) -> Result<(), Failure> {
        if depth.all(|path| !["png", "pgm"].contains(&self.written.extension(path).as_str())) {
            return Ok(());
        }
        Err(Failure::Input(format!(
            "{}: depth that is made of disparities is floating-point, which PNG and PGM cannot hold: give --format tiff, npy or exr",
            what.display()
        )))
    }

    fn folder(&self) -> &Path {
        self.out.as_deref().unwrap_or(Path::new("depthcal-out/apply"))
    }

    /// The files that a frame's results are written to.
    fn outputs(&self, job: &Job) -> Vec<PathBuf> {
        let image = self.target(&job.depth);
        let cloud = self.written.cloud.map(|cloud| image.with_extension(cloud.extension()));
        let uncertainty = self.written.uncertainty.paths(&image);
        std::iter::once(image).chain(cloud).chain(uncertainty).collect()
    }

    fn correct(
        &self,
        job: &Job,
        corrector: &Corrector,
        reach: Option<&Reach>,
    ) -> Result<(CorrectionSummary, Beyond), Failure> {
        let of_job = |error| Failure::Input(format!("{}: {error}", job.depth.display()));
        let (depth, image) = job.read(corrector)?;
        let context = FrameContext {
            time_s: job.time_s.unwrap_or(0.0),
            temperature_c: job.temperature_c.unwrap_or(f64::NAN),
            quantities: job.quantities,
            amplitude: image.as_ref().map(Into::into),
        };
        if let Some(format) = self.written.cloud {
            // Not from the corrected image, whose values are rounded to its unit.
            let points = points_of(&depth, job.unit_mm, corrector, &context).map_err(of_job)?;
            let path = self.target(&job.depth).with_extension(format.extension());
            let size = [depth.width, depth.height];
            let color = job.color.as_ref().map(|path| read_color(path, size)).transpose()?;
            format.write(&path, &cloud(&points, image.as_ref(), color.as_ref())).map_err(input)?;
        }
        let (corrected, summary) = self.written.correct(&depth, job.unit_mm, corrector, &context).map_err(of_job)?;
        if self.written.uncertainty.any() {
            let measured_mm = millimetres(&depth, job.unit_mm);
            self.written.uncertainty.write(measured_mm, corrector, &context, &self.target(&job.depth))?;
        }
        write_depth_frame(self.target(&job.depth), &corrected).map_err(input)?;
        Ok((summary, reach.map_or_else(Beyond::default, |reach| reach.beyond(&depth, job.unit_mm))))
    }

    fn print(&self, frames: usize, summary: CorrectionSummary) {
        let CorrectionSummary { corrected, saturated, invalid, not_correctable } = summary;
        say!("{}: {corrected} pixels corrected, {invalid} without depth", count(frames, "frame"));
        if not_correctable > 0 {
            say!(
                "{not_correctable} pixels cannot be corrected (no ray, or the model has no inverse there) and are set to 0"
            );
        }
        if saturated > 0 {
            say!("{saturated} corrected depths are beyond the range of 16 bits and are set to its end");
        }
        say!("written: {}", self.folder().display());
    }

    /// The path of the corrected image of `depth`.
    fn target(&self, depth: &Path) -> PathBuf {
        let name = depth.file_name().map_or_else(|| self.folder().to_owned(), |name| self.folder().join(name));
        name.with_extension(self.written.extension(depth))
    }

    fn jobs(&self, camera: &CameraRecord) -> Result<Vec<Job>, Failure> {
        let (images, colors) = (by_stem(&self.image)?, by_stem(&self.color)?);
        let mut jobs = Vec::new();
        for path in &self.depth {
            if path.ends_with(DATASET_FILE) || path.join(DATASET_FILE).is_file() {
                jobs.extend(self.dataset_jobs(path)?);
                continue;
            }
            let files = if path.is_dir() { images_in(path, DEPTH_EXTENSIONS)? } else { vec![path.clone()] };
            if let Some(first) = files.first().filter(|p| !p.is_file()) {
                return Err(Failure::Input(format!(
                    "{}: there is no such file or folder: check DEPTH",
                    first.display()
                )));
            }
            let (unit_mm, disparity) = self.meaning_of_files(path, camera)?;
            if disparity.is_some() {
                self.check_fractions(path, files.iter().map(PathBuf::as_path))?;
            }
            for depth in files {
                let image = images.get(&stem(&depth)).cloned();
                if image.is_none() && !self.image.is_empty() {
                    return Err(Failure::Input(format!(
                        "{}: --image has no image of the stem \"{}\": give one for every depth image, or none at all",
                        depth.display(),
                        stem(&depth)
                    )));
                }
                jobs.push(Job {
                    depth,
                    image,
                    color: None,
                    unit_mm,
                    disparity,
                    time_s: None,
                    temperature_c: None,
                    quantities: Quantities::NONE,
                });
            }
        }
        for job in jobs.iter_mut().filter(|_| !colors.is_empty()) {
            job.color = colors.get(&stem(&job.depth)).cloned();
            if job.color.is_none() {
                return Err(Failure::Input(format!(
                    "{}: --color has no image of the stem \"{}\": give one for every depth image, or none at all",
                    job.depth.display(),
                    stem(&job.depth)
                )));
            }
        }
        Ok(jobs)
    }

    fn dataset_jobs(&self, path: &Path) -> Result<Vec<Job>, Failure> {
        let dataset = Dataset::open(path).and_then(Dataset::into_only_camera).map_err(input)?;
        let file = dataset.root.join(DATASET_FILE);
        let Some(unit_mm) = dataset.unit_mm().filter(|_| dataset.has_depth()) else {
            return Err(Failure::Input(format!(
                "{}: `frames.depth` is missing, so there is nothing to correct: declare it, such as depth = \
                 \"depth/*.png\", and unit_mm under [depth]",
                file.display()
            )));
        };
        if let Some(given) = self.unit_mm.filter(|given| *given != unit_mm) {
            return Err(Failure::Input(format!(
                "{}: `depth.unit_mm` is {unit_mm}, but --unit-mm is {given}: leave --unit-mm out, or correct the file",
                file.display()
            )));
        }
        if dataset.disparity.is_some() {
            self.check_fractions(&file, dataset.frames.iter().filter_map(|frame| frame.depth.as_deref()))?;
        }
        print_pairing(&dataset);
        for stray in &dataset.strays {
            say!("  not corrected: {} ({})", stray.name, stray.reason);
        }
        // Times count from the first frame, as they did when the calibration was fitted.
        let first = dataset.frames.iter().filter_map(|f| f.metadata.timestamp_s).fold(f64::INFINITY, f64::min);
        let disparity = dataset.disparity;
        let jobs = dataset.frames.into_iter().filter_map(|frame| {
            Some(Job {
                depth: frame.depth?,
                image: frame.image,
                color: None,
                unit_mm,
                disparity,
                time_s: frame.metadata.timestamp_s.map(|t| t - first),
                temperature_c: frame.metadata.temperature_c,
                quantities: frame.metadata.quantities(),
            })
        });
        Ok(jobs.collect())
    }

    /// Refuses input whose corrected images would replace each other or their originals.
    fn check_names(&self, jobs: &[Job]) -> Result<(), Failure> {
        let out = self.folder().canonicalize().ok();
        let mut names = BTreeSet::new();
        for Job { depth, .. } in jobs {
            let folder = depth.canonicalize().ok().and_then(|path| path.parent().map(Path::to_owned));
            if out.is_some() && folder == out {
                return Err(Failure::Input(format!(
                    "{}: the corrected image would replace this one: give --out another folder",
                    depth.display()
                )));
            }
            // By stem, because the cloud has the same name but for its extension.
            if !names.insert(stem(depth)) {
                return Err(Failure::Input(format!(
                    "{}: another depth image has the stem \"{}\" too, and --out has one place for both: apply to one \
                     folder at a time",
                    depth.display(),
                    stem(depth)
                )));
            }
        }
        Ok(())
    }
}

/// The first camera of a calibration.
fn named(calibration: &Calibration, camera: &Camera) -> PlacedCamera {
    PlacedCamera { name: calibration.camera.name.clone(), ..unnamed_camera(camera.clone()) }
}

/// Warns of effects of the calibration that cannot be corrected because frames lack the quantity that they depend on.
fn warn_of_missing(corrector: &Corrector, jobs: &[Job]) {
    let needs = corrector.needs();
    let cases = [
        (needs.time, jobs.iter().any(|j| j.time_s.is_none()), "time", "timestamp_s in the dataset's table of frames"),
        (
            needs.temperature,
            jobs.iter().any(|j| j.temperature_c.is_none()),
            "temperature",
            "temperature_c in the dataset's table of frames",
        ),
        (needs.amplitude, jobs.iter().any(|j| j.image.is_none()), "infrared amplitude", "the images with --image"),
    ];
    let of_quantities = needs.quantities.into_iter().flatten().map(|quantity| {
        let missing = jobs.iter().any(|job| job.quantities.value(quantity).is_nan());
        (true, missing, quantity.name(), "it in the dataset's table of frames")
    });
    for (needed, missing, what, remedy) in cases.into_iter().chain(of_quantities) {
        if needed && missing {
            complaint(
                "warning",
                0,
                format_args!(
                    "the calibration has an effect that depends on the {what}, which not every frame has: it is not \
                     corrected there; give {remedy}"
                ),
            );
        }
    }
}

fn cloud(points: &[[f32; 3]], image: Option<&GrayImage>, color: Option<&RgbImage>) -> Cloud {
    let seen = || (0..points.len()).filter(|i| !points[*i][2].is_nan());
    Cloud {
        points: seen().map(|i| points[i]).collect(),
        intensity: image.map(|image| seen().map(|i| f32::from(image.data[i])).collect()),
        color: color.map(|color| seen().map(|i| color.data[i]).collect()),
    }
}
