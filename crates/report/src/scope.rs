//! The part of a page that sections belong to.

/// The part of a page that sections belong to: the whole page, or one of several cameras.
#[derive(Debug, Clone, Default)]
pub(super) struct Scope {
    /// Number of the camera, from 1; `None` of the whole page.
    camera: Option<usize>,
}

impl Scope {
    /// The part of camera number `number`, from 1, of a page of several.
    pub(super) fn camera(number: usize) -> Self {
        Self { camera: Some(number) }
    }

    /// The id of an element that is called `id` in this part: unique in the page.
    pub(super) fn id(&self, id: &str) -> String {
        self.camera.map_or_else(|| id.to_owned(), |number| format!("camera-{number}-{id}"))
    }

    /// Level of the sections' headings; those of figures are one below.
    pub(super) fn level(&self) -> u8 {
        if self.camera.is_some() { 3 } else { 2 }
    }
}
