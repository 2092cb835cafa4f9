//! A matcher that sees only some rows of the pictures.

use super::Matcher;

impl<const WIDTH: usize, const DISPARITIES: usize> Matcher<WIDTH, DISPARITIES> {
    /// Takes settings and plan of a matcher that is configured.
    ///
    /// # Bound
    /// The copying of about 2 KiB.
    pub(crate) fn configure_as(&mut self, other: &Self) {
        (self.settings, self.plan, self.width, self.height) = (other.settings, other.plan, other.width, other.height);
        self.key_limits.clone_from(&other.key_limits);
    }

    /// Takes `rows` neighbouring rows for a picture of its own from the next [`Self::begin`] on. Disparities are those of the whole
    /// picture where the margin above and below lies among the rows or beyond the edge of the picture.
    pub(crate) const fn set_height(&mut self, rows: usize) {
        self.height = rows;
    }
}
