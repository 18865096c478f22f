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
    ///
    /// ```
    /// use sastrugi_schemas::RoughnessClass;
    ///
    /// assert_eq!(RoughnessClass::from_code(1), Some(RoughnessClass::Semi));
    /// assert_eq!(RoughnessClass::from_code(RoughnessClass::NO_DATA), None);
    /// ```
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

    /// sRGB colour on maps and meshes: the paper's blue, orange and yellow, in shades that readers with colour vision deficiency
    /// can distinguish.
    pub fn colour(self) -> [u8; 3] {
        match self {
            Self::Low => [0x3b, 0x6f, 0xb6],
            Self::Semi => [0xe0, 0x8a, 0x2e],
            Self::High => [0xf6, 0xdf, 0x4a],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::RoughnessClass;

    /// Codes in rasters, order, names in tables, and colours that can be told apart.
    #[test]
    fn val_classes() {
        let all = RoughnessClass::ALL;
        assert_eq!(all.map(|class| class as u8), [0, 1, 2]);
        assert_eq!(all.map(|class| RoughnessClass::from_code(class as u8)), all.map(Some));
        assert!((3..=255).all(|code| RoughnessClass::from_code(code).is_none()));
        assert_eq!(all.map(RoughnessClass::name), ["low", "semi", "high"]);
        assert!(RoughnessClass::Low < RoughnessClass::Semi && RoughnessClass::Semi < RoughnessClass::High);
        let [low, semi, high] = all.map(RoughnessClass::colour);
        assert!(low != semi && semi != high && low != high);
    }
}
