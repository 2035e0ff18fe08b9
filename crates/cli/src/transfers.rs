//! Transfer errors in words.

use depthcal_io::TransferError;
use depthcal_report::format::quantity;

use crate::voice::say;

/// Transfer errors, as a table.
pub(crate) fn print_transfers(transfers: &[TransferError]) {
    if transfers.is_empty() {
        return;
    }
    say!("\ntransfer errors: markers through corrected depth into another camera's image");
    say!("{:<16} {:<16} {:>8}  {:>12}  {:>12}  {:>12}", "from", "to", "markers", "before", "after", "after");
    for t in transfers {
        let (before, px, mm) = (quantity(t.before_rms_px, "px"), quantity(t.rms_px, "px"), quantity(t.rms_mm, "mm"));
        say!("{:<16} {:<16} {:>8}  {before:>12}  {px:>12}  {mm:>12}", t.from, t.to, t.markers);
    }
}
