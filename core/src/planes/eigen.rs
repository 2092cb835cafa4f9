//! Eigenvalues and eigenvectors of symmetric 3 x 3 matrices, in closed form.
//!
//! A plane fitted by orthogonal distance regression has the eigenvector of its covariance's smallest eigenvalue as normal.
//! The textbook closed form loses half of the digits where two eigenvalues lie close together, and there is where a normal
//! may be wrong without anybody noticing. So the trigonometric formula (Smith, *Eigenvalues of a symmetric 3 x 3 matrix*,
//! CACM 4(4), 1961) serves for the one eigenvalue that lies apart from the other two; those two are the eigenvalues of a
//! 2 x 2 matrix in the plane across its vector (Eberly, *A Robust Eigensolver for 3 x 3 Symmetric Matrices*, 2014), and
//! that matrix is summed up in pairs of f32, so that their difference keeps its digits.

/// The largest tilt of a returned vector against the exact one, degrees, rounding of the matrix to f32 included.
pub const MAX_TILT_DEG: f32 = 0.01;

/// Distance of an eigenvalue from its neighbour, relative to the largest magnitude of the three, from which on its vector
/// is told.
///
/// Rounding the entries of a matrix `A` to f32 moves it by up to `2^-24 |A|_F <= 2^-24 sqrt(3) l_max`, and an eigenvector
/// with the relative gap `g` turns by up to about `2^-24 sqrt(3) / g`: by 0.00986 degrees at this gap. Below it, f32 entries
/// do not hold the direction to [`MAX_TILT_DEG`], however they are solved.
pub const MIN_RELATIVE_GAP: f32 = 6.0e-4;

/// A symmetric 3 x 3 matrix: the upper triangle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SymmetricMatrix3 {
    /// Row x, column x.
    pub xx: f32,
    /// Row x, column y.
    pub xy: f32,
    /// Row x, column z.
    pub xz: f32,
    /// Row y, column y.
    pub yy: f32,
    /// Row y, column z.
    pub yz: f32,
    /// Row z, column z.
    pub zz: f32,
}

/// Eigenvalues of a [`SymmetricMatrix3`], and the vectors at both ends where the matrix defines them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eigen {
    /// Eigenvalues, ascending, in the unit of the matrix; within 1e-5 of the largest magnitude among them. Those beyond the
    /// range of f32 are held at its end.
    pub values: [f32; 3],
    /// Unit vector of the smallest eigenvalue, the normal of a plane; its sign is arbitrary. `None` if the smallest and the
    /// middle eigenvalue lie closer than [`MIN_RELATIVE_GAP`].
    pub smallest: Option<[f32; 3]>,
    /// Unit vector of the largest eigenvalue, the direction of an edge; its sign is arbitrary. `None` if the largest and the
    /// middle eigenvalue lie closer than [`MIN_RELATIVE_GAP`].
    pub largest: Option<[f32; 3]>,
}

impl SymmetricMatrix3 {
    /// Solves for the eigenvalues, and for the vectors of the smallest and the largest; `None` if an entry is not finite.
    ///
    /// # Bound
    /// No loop; about 900 floating-point operations.
    pub fn eigen(&self) -> Option<Eigen> {
        let magnitude = self.entries().iter().fold(0.0_f32, |m, e| m.max(e.abs()));
        if !self.entries().iter().all(|e| e.is_finite()) {
            return None;
        }
        if magnitude == 0.0 {
            return Some(Eigen::isotropic(0.0));
        }
        // A power of two scales without rounding, subnormal entries too.
        let exponent = libm::ilogbf(magnitude);
        let mut eigen = solve(&self.scaled(exponent.saturating_neg()));
        for value in &mut eigen.values {
            *value = libm::ldexpf(*value, exponent).clamp(-f32::MAX, f32::MAX);
        }
        Some(eigen)
    }

    fn entries(&self) -> [f32; 6] {
        [self.xx, self.xy, self.xz, self.yy, self.yz, self.zz]
    }

    fn scaled(&self, exponent: i32) -> Self {
        let [xx, xy, xz, yy, yz, zz] = self.entries().map(|e| libm::ldexpf(e, exponent));
        Self { xx, xy, xz, yy, yz, zz }
    }

    fn determinant(&self) -> f32 {
        self.xx * (self.yy * self.zz - self.yz * self.yz) - self.xy * (self.xy * self.zz - self.yz * self.xz)
            + self.xz * (self.xy * self.yz - self.yy * self.xz)
    }

    fn times(&self, v: [f32; 3]) -> [f32; 3] {
        [dot([self.xx, self.xy, self.xz], v), dot([self.xy, self.yy, self.yz], v), dot([self.xz, self.yz, self.zz], v)]
    }
}

impl Eigen {
    const fn isotropic(value: f32) -> Self {
        Self { values: [value; 3], smallest: None, largest: None }
    }

    /// Distance of the smallest eigenvalue from the middle one, relative to the largest magnitude of the three.
    pub fn lower_gap(&self) -> f32 {
        self.relative(self.values[1] - self.values[0])
    }

    /// Distance of the middle eigenvalue from the largest one, relative to the largest magnitude of the three.
    pub fn upper_gap(&self) -> f32 {
        self.relative(self.values[2] - self.values[1])
    }

    fn relative(&self, gap: f32) -> f32 {
        let largest = self.values[0].abs().max(self.values[2].abs());
        if largest > 0.0 { gap / largest } else { 0.0 }
    }
}

/// Solves a matrix whose largest entry lies within 1 and 2.
fn solve(matrix: &SymmetricMatrix3) -> Eigen {
    // Around the mean, three eigenvalues close together come apart: the subtraction is exact where it cancels, and what it
    // rounds away elsewhere is kept.
    let mean = (matrix.xx + matrix.yy + matrix.zz) / 3.0;
    let diagonal = [matrix.xx, matrix.yy, matrix.zz].map(|e| Pair::sum(e, -mean));
    // The formula below holds for a trace of zero: the rounding of the mean itself would show where all three lie close.
    let rest = (diagonal[0].hi + diagonal[1].hi + diagonal[2].hi) / 3.0;
    let diagonal = diagonal.map(|d| d.add(Pair::from(-rest)));
    let deviation = SymmetricMatrix3 { xx: diagonal[0].hi, yy: diagonal[1].hi, zz: diagonal[2].hi, ..*matrix };

    let off_diagonal = deviation.xy * deviation.xy + deviation.xz * deviation.xz + deviation.yz * deviation.yz;
    let on_diagonal = deviation.xx * deviation.xx + deviation.yy * deviation.yy + deviation.zz * deviation.zz;
    let spread = libm::sqrtf((on_diagonal + 2.0 * off_diagonal) / 6.0);
    // The eigenvalues lie within twice the spread of the mean.
    if spread < 1.0e-6 {
        return Eigen::isotropic(mean);
    }
    let half_determinant = deviation.determinant() / (2.0 * spread * spread * spread);
    let apart_is_largest = half_determinant >= 0.0;
    // cos(acos(|d|) / 3) is flat where acos is steep: no digits are lost.
    let apart_magnitude = 2.0 * spread * libm::cosf(libm::acosf(half_determinant.abs().min(1.0)) / 3.0);
    let estimate = if apart_is_largest { apart_magnitude } else { -apart_magnitude };
    let Some(apart_vector) = vector_of(&deviation, estimate) else {
        return Eigen::isotropic(mean);
    };
    let apart = dot(apart_vector, deviation.times(apart_vector));

    let across = Across::new(&deviation, diagonal, apart_vector, -0.5 * apart);
    let (low, high) = (across.low(), across.high());

    let (deviations, smallest, largest) = if apart_is_largest {
        ([low, high, apart.max(high)], across.low_vector(), Some(apart_vector))
    } else {
        ([apart.min(low), low, high], Some(apart_vector), across.high_vector())
    };
    // The gap between the two that lie close is known to more digits than they are themselves.
    let close_gap = 2.0 * across.half_gap;
    let (lower_gap, upper_gap) = if apart_is_largest { (close_gap, apart - high) } else { (low - apart, close_gap) };
    let values = deviations.map(|d| mean + (rest + d));
    let needed = MIN_RELATIVE_GAP * values[0].abs().max(values[2].abs());
    Eigen {
        values,
        smallest: smallest.filter(|_| lower_gap >= needed),
        largest: largest.filter(|_| upper_gap >= needed),
    }
}

/// The unit vector of an eigenvalue that lies apart from the others: it is at right angles to every row of the matrix
/// minus the eigenvalue, and the longest cross product of two rows is the one with the least rounding.
fn vector_of(matrix: &SymmetricMatrix3, value: f32) -> Option<[f32; 3]> {
    let rows = [
        [matrix.xx - value, matrix.xy, matrix.xz],
        [matrix.xy, matrix.yy - value, matrix.yz],
        [matrix.xz, matrix.yz, matrix.zz - value],
    ];
    let mut longest = cross(rows[0], rows[1]);
    for candidate in [cross(rows[1], rows[2]), cross(rows[2], rows[0])] {
        if dot(candidate, candidate) > dot(longest, longest) {
            longest = candidate;
        }
    }
    unit(longest)
}

/// The 2 x 2 problem in the plane across a known eigenvector.
struct Across {
    axes: [[f32; 3]; 2],
    /// Mean of both eigenvalues.
    middle: f32,
    /// Half the distance between them.
    half_gap: f32,
    /// Half the difference of the diagonal, and the entry beside it.
    half_difference: f32,
    beside: f32,
}

impl Across {
    /// `diagonal` is that of `matrix` in full; `shift` lies near both eigenvalues, so that what remains is small and the
    /// axes may be a rounding error away from right angles.
    fn new(matrix: &SymmetricMatrix3, diagonal: [Pair; 3], known: [f32; 3], shift: f32) -> Self {
        // The axis is made from z and the larger of x and y: these cannot both be small.
        let [x, y, z] = known;
        let first = if x.abs() > y.abs() { [-z, 0.0, x] } else { [0.0, z, -y] };
        let first = unit(first).unwrap_or([1.0, 0.0, 0.0]);
        let second = unit(cross(known, first)).unwrap_or([0.0, 1.0, 0.0]);

        let [xx, yy, zz] = diagonal.map(|d| d.add(Pair::from(-shift)));
        let [xy, xz, yz] = [matrix.xy, matrix.xz, matrix.yz].map(Pair::from);
        let rows = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
        let first_image = rows.map(|row| dot_pairs(row, first));
        let second_image = rows.map(|row| dot_pairs(row, second));
        let a = dot_pairs(first_image, first);
        let b = dot_pairs(first_image, second).value();
        let c = dot_pairs(second_image, second);

        let half_difference = 0.5 * a.add(c.negated()).value();
        let half_gap = libm::sqrtf(half_difference * half_difference + b * b);
        Self { axes: [first, second], middle: shift + 0.5 * a.add(c).value(), half_gap, half_difference, beside: b }
    }

    fn low(&self) -> f32 {
        self.middle - self.half_gap
    }

    fn high(&self) -> f32 {
        self.middle + self.half_gap
    }

    fn high_vector(&self) -> Option<[f32; 3]> {
        let (s, t) = self.high_coordinates();
        self.in_space(s, t)
    }

    fn low_vector(&self) -> Option<[f32; 3]> {
        let (s, t) = self.high_coordinates();
        self.in_space(-t, s)
    }

    /// Of the two equations for the vector, the one in which nothing cancels.
    fn high_coordinates(&self) -> (f32, f32) {
        if self.half_difference >= 0.0 {
            (self.half_difference + self.half_gap, self.beside)
        } else {
            (self.beside, self.half_gap - self.half_difference)
        }
    }

    fn in_space(&self, s: f32, t: f32) -> Option<[f32; 3]> {
        // Small numbers first get to a size whose squares do not vanish.
        let size = s.abs().max(t.abs());
        if size < f32::MIN_POSITIVE {
            return None;
        }
        let (s, t) = (s / size, t / size);
        let [first, second] = self.axes;
        unit(core::array::from_fn(|i| s * first[i] + t * second[i]))
    }
}

/// A number as the sum of two f32, the second below half a unit in the last place of the first: about 48 bits.
#[derive(Clone, Copy)]
struct Pair {
    hi: f32,
    lo: f32,
}

impl Pair {
    const fn from(value: f32) -> Self {
        Self { hi: value, lo: 0.0 }
    }

    /// The exact sum (Knuth's two-sum).
    fn sum(a: f32, b: f32) -> Self {
        let hi = a + b;
        let b_part = hi - a;
        Self { hi, lo: (a - (hi - b_part)) + (b - b_part) }
    }

    /// The exact product (Dekker, 1971); a fused multiply-add would do, but `libm` works it out in software.
    fn product(a: f32, b: f32) -> Self {
        let hi = a * b;
        let ((a_hi, a_lo), (b_hi, b_lo)) = (split(a), split(b));
        Self { hi, lo: ((a_hi * b_hi - hi) + a_hi * b_lo + a_lo * b_hi) + a_lo * b_lo }
    }

    fn add(self, other: Self) -> Self {
        let sum = Self::sum(self.hi, other.hi);
        Self::sum(sum.hi, sum.lo + (self.lo + other.lo))
    }

    fn times(self, factor: f32) -> Self {
        let product = Self::product(self.hi, factor);
        Self { hi: product.hi, lo: product.lo + self.lo * factor }
    }

    fn negated(self) -> Self {
        Self { hi: -self.hi, lo: -self.lo }
    }

    fn value(self) -> f32 {
        self.hi + self.lo
    }
}

/// Splits into two numbers of 12 bits each (Veltkamp).
fn split(a: f32) -> (f32, f32) {
    let scaled = 4097.0 * a;
    let hi = scaled - (scaled - a);
    (hi, a - hi)
}

fn dot_pairs(a: [Pair; 3], b: [f32; 3]) -> Pair {
    a[0].times(b[0]).add(a[1].times(b[1])).add(a[2].times(b[2]))
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(v: [f32; 3]) -> Option<[f32; 3]> {
    let length = libm::sqrtf(dot(v, v));
    if length > 0.0 { Some(v.map(|c| c / length)) } else { None }
}

#[cfg(test)]
#[path = "eigen_tests.rs"]
mod tests;
