//! Camera poses, `world_from_camera`: rigid, checked, re-orthonormalised.

use crate::error::{Error, Result};
use nalgebra::{Matrix3, Vector3};

/// A rigid transform from camera to world coordinates, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Columns are the camera's axes in the world.
    pub rotation: Matrix3<f64>,
    /// The camera centre in the world.
    pub translation: Vector3<f64>,
}

impl Pose {
    /// How far each entry of `R^T R` may lie from the identity: real data sets need that much.
    pub const ORTHONORMAL_TOLERANCE: f64 = 2e-3;

    /// The camera at the world's origin, looking along +z.
    pub fn identity() -> Self {
        Self { rotation: Matrix3::identity(), translation: Vector3::zeros() }
    }

    /// Checks a 4x4 matrix given row by row; a nearly orthonormal rotation is replaced by the nearest one.
    ///
    /// # Errors
    /// [`Error::Pose`] naming the entry that is not finite, breaks the last row `0 0 0 1`, or makes `R^T R`
    /// differ from the identity by more than [`Self::ORTHONORMAL_TOLERANCE`]; or saying that the rotation is a mirror.
    pub fn from_rows(m: &[[f64; 4]; 4]) -> Result<Self> {
        let refuse = |row: usize, column: usize, got: f64, expected: &str| {
            Err(Error::Pose { entry: format!("[{row}, {column}]"), got, expected: expected.into() })
        };
        for (r, row) in m.iter().enumerate() {
            for (c, &value) in row.iter().enumerate() {
                if !value.is_finite() {
                    return refuse(r, c, value, "a finite number");
                }
            }
        }
        for (c, expected) in [0.0, 0.0, 0.0, 1.0].into_iter().enumerate() {
            if (m[3][c] - expected).abs() > 1e-9 {
                return refuse(3, c, m[3][c], "a last row of 0 0 0 1");
            }
        }
        let rotation = Matrix3::from_fn(|r, c| m[r][c]);
        let gram = rotation.transpose() * rotation;
        for r in 0..3 {
            for c in r..3 {
                let expected = if r == c { 1.0 } else { 0.0 };
                if (gram[(r, c)] - expected).abs() > Self::ORTHONORMAL_TOLERANCE {
                    return Err(Error::Pose {
                        entry: format!("column {r} . column {c} of the rotation"),
                        got: gram[(r, c)],
                        expected: format!("{expected} within {}", Self::ORTHONORMAL_TOLERANCE),
                    });
                }
            }
        }
        if rotation.determinant() < 0.0 {
            return Err(Error::Pose {
                entry: "determinant of the rotation".into(),
                got: rotation.determinant(),
                expected: "1 (this one is a mirror image)".into(),
            });
        }
        Ok(Self { rotation: nearest_rotation(rotation), translation: Vector3::new(m[0][3], m[1][3], m[2][3]) })
    }

    /// A world point in camera coordinates.
    pub fn camera_from_world(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.rotation.transpose() * (point - self.translation)
    }
}

/// Newton's iteration for the orthogonal factor of the polar decomposition, `X <- (X + X^-T) / 2`. It converges
/// quadratically: from within the tolerance above, three steps reach rounding error. An exact rotation stays as it is.
fn nearest_rotation(mut x: Matrix3<f64>) -> Matrix3<f64> {
    for _ in 0..4 {
        let inverse = x.try_inverse().expect("checked to be within a hair of a rotation");
        x = (x + inverse.transpose()) * 0.5;
    }
    x
}
