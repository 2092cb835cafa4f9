//! Pictures inside a page.

use base64::{Engine, prelude::BASE64_STANDARD};
use serde::Serialize;

use crate::paint::Canvas;

/// A picture as a page carries it.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Embedded {
    width: usize,
    height: usize,
    uri: String,
}

impl Embedded {
    /// The picture, thinned until it is at most `widest` px wide.
    pub fn new(canvas: &Canvas, widest: usize) -> Self {
        let thinned = canvas.thinned(canvas.width().div_ceil(widest));
        Self {
            width: thinned.width(),
            height: thinned.height(),
            uri: format!("data:image/png;base64,{}", BASE64_STANDARD.encode(thinned.small_png())),
        }
    }
}
