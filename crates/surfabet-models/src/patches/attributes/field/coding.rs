//! The ways to code a field that files have.

/// How the values of cells are predicted and coded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum FieldCoding {
    /// Predicted from the means of their parents and of the cells beside these. The first files are so, and those without
    /// attributes.
    #[default]
    Parents,
    /// Also from what was missed at the cells beside them that are coded already.
    Beside,
    /// As [`FieldCoding::Beside`], in whole numbers, so that the models of coefficients may depend on the prediction.
    Whole,
    /// As [`FieldCoding::Whole`], with estimates of small networks beside the models.
    Estimated,
}
