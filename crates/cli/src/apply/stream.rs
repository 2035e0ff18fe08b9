//! `apply -`: raw frames from standard input to standard output.

use std::io::{self, ErrorKind, Read, Write};
use std::path::Path;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;

use depthcal_io::DepthImage;
use depthcal_model::Quantity;
use depthcal_report::format::count;

use super::stream_args::{FrameInput, FrameJob, Raw, StreamArgs, Written, bytes_of, in_steps};
use super::stream_register::{RegisterJob, Registered};
use crate::common::above_zero;
use crate::failure::Failure;
use crate::progress::Progress;
use crate::voice::{self, complaint, note};
use depthcal_correction::{CorrectionSummary, Corrector, CorrectorError, PointsMut};

/// The calibration of a stream.
pub(super) struct StreamContext<'a> {
    pub(super) corrector: &'a Corrector,
    pub(super) unit_mm: Option<f64>,
    pub(super) calibration: &'a Path,
    /// The cameras of a rig between which depth is registered.
    pub(super) register: Option<Registered>,
}

/// Buffers between reading, correcting and writing, so that the three run in parallel.
const UNDER_WAY: usize = 3;

impl StreamArgs {
    pub(super) fn run(&self, context: StreamContext<'_>) -> Result<(), Failure> {
        let (width, height) = (context.corrector.width(), context.corrector.height());
        let written = self.stream_output.unwrap_or(Written::U16);
        self.check(&context, written, (width, height))?;
        let input = FrameInput::new(self, context.corrector, context.unit_mm.unwrap_or(1.0));
        let mut job: Box<dyn FrameJob> = match &context.register {
            Some(cameras) => Box::new(RegisterJob::new(input, cameras, written)),
            None => Box::new(Job::new(input, written)),
        };
        let frame_bytes = job.frame_bytes();

        let (full, to_correct) = sync_channel::<Vec<u8>>(UNDER_WAY);
        let (emptied, to_fill) = sync_channel::<Vec<u8>>(UNDER_WAY);
        let (corrected, to_write) = sync_channel::<Vec<u8>>(UNDER_WAY);
        let (flushed, to_reuse) = sync_channel::<Vec<u8>>(UNDER_WAY);
        for _ in 0..UNDER_WAY {
            // Cannot fail: the channels have room for as many.
            let _ = (emptied.send(vec![0; frame_bytes]), flushed.send(Vec::new()));
        }
        let progress = Progress::endless("correcting");
        thread::scope(|scope| {
            let reader = scope.spawn(move || read_frames(io::stdin().lock(), &to_fill, &full));
            let writer = scope.spawn(move || write_frames(voice::frames(), &to_write, &flushed));
            let mut summary = CorrectionSummary::default();
            let mut frames = 0;
            let mut result = Ok(());
            while let Ok(frame) = to_correct.recv() {
                let Ok(mut out) = to_reuse.recv() else { break };
                match job.correct(frames, &frame, &mut out) {
                    Ok(of_frame) => summary += of_frame,
                    Err(error) => {
                        result = Err(Failure::Input(error.to_string()));
                        break;
                    }
                }
                frames += 1;
                progress.advance();
                let _ = emptied.send(frame);
                if corrected.send(out).is_err() {
                    break;
                }
            }
            drop((corrected, to_reuse, to_correct, emptied));
            let written = writer.join().unwrap_or_else(|_| Err(io::Error::other("the writing thread failed")));
            if let Err(error) = &written {
                // The program that reads the output has ended, which is no error. The reading thread still waits for input.
                if error.kind() == ErrorKind::BrokenPipe {
                    std::process::exit(0);
                }
                return Err(Failure::Input(format!("standard output: cannot write frame {frames}: {error}")));
            }
            let read = reader.join().unwrap_or_else(|_| Err(io::Error::other("the reading thread failed")));
            drop(progress);
            report(frames, summary);
            result.and(read.map_err(|error| {
                Failure::Input(format!(
                    "standard input: {error} after {} of {width}×{height} ({frame_bytes} bytes each): check --stream-input, \
                     and that the frames have the calibrated size",
                    count(frames, "frame")
                ))
            }))
        })
    }

    fn check(
        &self,
        context: &StreamContext<'_>,
        written: Written,
        (width, height): (usize, usize),
    ) -> Result<(), Failure> {
        if let Some(size) = self.stream_size.as_ref().filter(|size| **size != format!("{width}x{height}")) {
            return Err(Failure::Input(format!(
                "--stream-size is {size}, but the calibration is for {width}x{height}: give frames of the calibrated \
                 camera at its full resolution"
            )));
        }
        if written == Written::Xyzrgb && !self.stream_color {
            return Err(Failure::Input(
                "--stream-output xyzrgb needs the colours: give --register CAMERA and --stream-color, and let its image follow each \
                 depth frame"
                    .to_owned(),
            ));
        }
        let needs_unit = self.stream_input == Raw::U16 || written == Written::U16;
        if needs_unit && context.unit_mm.is_none() {
            return Err(Failure::Input(format!(
                "the depth unit is unknown: {} does not record it; give --unit-mm, the millimetres per step of the frames",
                context.calibration.display()
            )));
        }
        above_zero("--stream-fps", self.stream_fps, "the frames per second, such as 30")?;
        let needs = context.corrector.needs();
        let missing = [
            (needs.time && self.stream_fps.is_none(), "time", "--stream-fps"),
            (needs.temperature && self.stream_temperature.is_none(), "temperature", "--stream-temperature"),
            (needs.amplitude && !self.stream_amplitude, "infrared amplitude", "--stream-amplitude"),
        ];
        let given = |quantity: &Quantity| self.stream_value.iter().any(|given| given.quantity == *quantity);
        let not_given = needs.quantities.into_iter().flatten().filter(|quantity| !given(quantity));
        let missing = missing.into_iter().chain(not_given.map(|quantity| (true, quantity.name(), "--stream-value")));
        for (_, what, remedy) in missing.filter(|(missing, ..)| *missing) {
            complaint(
                "warning",
                0,
                format_args!(
                    "the calibration has an effect that depends on the {what}: it is not corrected; give {remedy}"
                ),
            );
        }
        Ok(())
    }
}

/// Correction of the frames of one camera.
struct Job<'a> {
    input: FrameInput<'a>,
    written: Written,
    out_steps: DepthImage,
    points: Vec<f32>,
}

impl<'a> Job<'a> {
    fn new(input: FrameInput<'a>, written: Written) -> Self {
        let points = vec![0.0; if written == Written::Xyz { 3 * input.millimetres.len() } else { 0 }];
        Self { out_steps: input.steps.clone(), input, written, points }
    }
}

impl FrameJob for Job<'_> {
    fn frame_bytes(&self) -> usize {
        self.input.bytes()
    }

    fn correct(&mut self, index: usize, frame: &[u8], out: &mut Vec<u8>) -> Result<CorrectionSummary, CorrectorError> {
        self.input.take(frame);
        if matches!(self.written, Written::Xyz | Written::Xyzrgb) {
            let summary = self.input.points(index, PointsMut::Interleaved(&mut self.points))?;
            bytes_of(self.points.iter().map(|c| c.to_le_bytes()), out);
            return Ok(summary);
        }
        let FrameInput { args, corrector, unit_mm, steps, millimetres, amplitude } = &mut self.input;
        let (context, unit_mm) = (args.context(index, amplitude), *unit_mm);
        if (args.stream_input, self.written) == (Raw::U16, Written::U16) {
            let summary = corrector.correct_u16(steps, unit_mm, &context, &mut self.out_steps)?;
            bytes_of(self.out_steps.data.iter().map(|z| z.to_le_bytes()), out);
            return Ok(summary);
        }
        let summary = match args.stream_input {
            Raw::F32 => corrector.correct_f32_in_place(millimetres, &context)?,
            Raw::U16 => corrector.correct_u16_to_f32(steps, unit_mm, &context, millimetres)?,
        };
        match self.written {
            Written::U16 => bytes_of(millimetres.iter().map(|z| in_steps(*z, unit_mm).to_le_bytes()), out),
            _ => bytes_of(millimetres.iter().map(|z| z.to_le_bytes()), out),
        }
        Ok(summary)
    }
}

/// Reads whole frames until the stream ends.
fn read_frames(mut stream: impl Read, empty: &Receiver<Vec<u8>>, full: &SyncSender<Vec<u8>>) -> io::Result<()> {
    let mut number = 0;
    while let Ok(mut frame) = empty.recv() {
        number += 1;
        let mut filled = 0;
        while filled < frame.len() {
            match stream.read(&mut frame[filled..]) {
                Ok(0) if filled == 0 => return Ok(()),
                Ok(0) => {
                    let message = format!("frame {number} ends after {filled} of its {} bytes", frame.len());
                    return Err(io::Error::other(message));
                }
                Ok(n) => filled += n,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        if full.send(frame).is_err() {
            break;
        }
    }
    Ok(())
}

fn write_frames(mut stream: impl Write, full: &Receiver<Vec<u8>>, empty: &SyncSender<Vec<u8>>) -> io::Result<()> {
    while let Ok(frame) = full.recv() {
        stream.write_all(&frame)?;
        stream.flush()?;
        let _ = empty.send(frame);
    }
    Ok(())
}

/// On standard error, because the frames are on standard output.
fn report(frames: usize, summary: CorrectionSummary) {
    let CorrectionSummary { corrected, saturated, invalid, not_correctable } = summary;
    note!("{}: {corrected} pixels corrected, {invalid} without depth", count(frames, "frame"));
    if not_correctable > 0 || saturated > 0 {
        note!("{not_correctable} pixels cannot be corrected, {saturated} are beyond the range of their type");
    }
}
