//! Roughness classes and their colours.

/// Class of a cell by its largest Moore-neighbourhood gradient (Majhor and Bos, section 2.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum RoughnessClass {
    /// Smooth and easily driven: vehicles start here.
    Low = 0,
    /// Moderately rough: goals may lie here.
    Semi = 1,
    /// Likely to stop or tip a vehicle.
    High = 2,
}

impl RoughnessClass {
    /// Code of a cell without a class (no data in its neighbourhood).
    pub const NO_DATA: u8 = 255;
    /// All classes in order.
    pub const ALL: [Self; 3] = [Self::Low, Self::Semi, Self::High];

    /// The class of a stored code; `None` for [`Self::NO_DATA`] and anything unknown.
    pub fn from_code(code: u8) -> Option<Self> {
        Self::ALL.get(usize::from(code)).copied()
    }

    /// Name in tables and legends.
    pub fn name(self) -> &'static str {
        match self {
            Self::Low => "low",
            Self::Semi => "semi",
            Self::High => "high",
        }
    }

    /// sRGB colour on maps and meshes: the paper's blue, orange and yellow, in shades that stay apart for readers with
    /// colour vision deficiency.
    pub fn colour(self) -> [u8; 3] {
        match self {
            Self::Low => [0x3b, 0x6f, 0xb6],
            Self::Semi => [0xe0, 0x8a, 0x2e],
            Self::High => [0xf6, 0xdf, 0x4a],
        }
    }
}
