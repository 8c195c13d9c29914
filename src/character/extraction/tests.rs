//! Laws of extraction on shapes made by rule.
