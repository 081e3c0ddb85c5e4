//! Reads and writes `[effect.uncertainty]`: the covariance of an effect's parameters, written as a matrix, or as
//! factors if there are many parameters. For effects that were identified together, each effect has its own rows of one
//! common factor.

use nalgebra::DMatrix;

/// Covariances of more parameters than this are written as factors. As matrices they would be most of the file.
const MANY: usize = 64;

/// Uncertainty of an effect's parameters, in their order and units.
///
/// # Examples
/// ```
/// use deflex_cell::Uncertainty;
///
/// let uncertainty = Uncertainty::Own(vec![vec![1e-8]]); // the variance of one parameter
/// ```
#[derive(Clone, Debug)]
pub enum Uncertainty {
    /// The covariance matrix, row by row.
    Own(Vec<Vec<f64>>),
    /// The rows of a factor L that belong to the effect's parameters. L Lᵀ is the covariance of the parameters of all
    /// effects that have such rows. Zeros at the end of a row are omitted.
    Joint(Vec<Vec<f64>>),
}

/// Key of the rows of a common factor.
const JOINT: &str = "joint_factor";

/// The keys of which a table has one.
pub(super) const KEYS: [&str; 3] = ["covariance", "factors", JOINT];

/// Decimals of a common factor's numbers in scientific notation. It has a number for every pair of parameters, so it is
/// short.
const JOINT_DIGITS: usize = 3;

/// Decimals of a factor's numbers in scientific notation. The standard deviation of anything that depends on the
/// parameters keeps four digits.
const DIGITS: usize = 5;

/// The table of an uncertainty: the rows of `covariance`, or for many parameters `factors`. These are the lower
/// triangles L of the diagonal blocks L Lᵀ, row by row.
pub(super) fn table(uncertainty: &Uncertainty) -> toml::Table {
    let covariance = match uncertainty {
        Uncertainty::Own(covariance) => covariance,
        Uncertainty::Joint(rows) => {
            let short = |value: &f64| format!("{value:.JOINT_DIGITS$e}").parse().unwrap_or(*value);
            let used = |row: &Vec<f64>| row.iter().rposition(|value| value.abs() > 0.0).map_or(0, |last| last + 1);
            let rows: Vec<Vec<f64>> = rows.iter().map(|row| row[..used(row)].iter().map(short).collect()).collect();
            return toml::Table::from_iter([(JOINT.to_owned(), rows.into())]);
        }
    };
    let factors = (covariance.len() > MANY).then(|| factors(covariance)).flatten();
    let (key, value): (&str, toml::Value) = match factors {
        Some(factors) => ("factors", factors.into()),
        None => ("covariance", covariance.to_vec().into()),
    };
    toml::Table::from_iter([(key.to_owned(), value)])
}

/// The factors of the diagonal blocks; `None` if a block is not positive definite.
fn factors(covariance: &[Vec<f64>]) -> Option<Vec<Vec<Vec<f64>>>> {
    let factor = |block: std::ops::Range<usize>| {
        let n = block.len();
        let lower = DMatrix::from_fn(n, n, |i, j| covariance[block.start + i][block.start + j]).cholesky()?.unpack();
        Some((0..n).map(|i| (0..=i).map(|j| rounded(lower[(i, j)])).collect()).collect())
    };
    blocks(covariance).into_iter().map(factor).collect()
}

/// Ranges of parameters that are not correlated with any parameter outside of the range.
fn blocks(covariance: &[Vec<f64>]) -> Vec<std::ops::Range<usize>> {
    let mut all = Vec::new();
    let (mut start, mut end) = (0, 0);
    for (i, row) in covariance.iter().enumerate() {
        if i > end {
            all.push(start..i);
            start = i;
        }
        end = end.max(row.iter().rposition(|value| value.abs() > 0.0).unwrap_or(i)).max(i);
    }
    all.push(start..covariance.len());
    all
}

fn rounded(value: f64) -> f64 {
    format!("{value:.DIGITS$e}").parse().unwrap_or(value)
}

/// The rows of a common factor for `size` parameters; `None` if the table has none of this size.
pub(super) fn read_joint(table: &toml::Value, size: usize) -> Option<DMatrix<f64>> {
    let rows: Vec<Vec<f64>> = table.get(JOINT)?.clone().try_into().ok()?;
    let wide = rows.iter().map(Vec::len).max().unwrap_or(0);
    let factor = DMatrix::from_fn(rows.len(), wide, |i, j| rows[i].get(j).copied().unwrap_or(0.0));
    (rows.len() == size && factor.iter().all(|value| value.is_finite())).then_some(factor)
}

/// The covariance of `size` parameters; `None` if the table has none of this size.
pub(super) fn read(table: &toml::Value, size: usize) -> Option<DMatrix<f64>> {
    let mut whole = DMatrix::zeros(size, size);
    if table.get(JOINT).is_some() {
        return read_joint(table, size).map(|factor| &factor * factor.transpose());
    }
    if let Some(factors) = table.get("factors") {
        let factors: Vec<Vec<Vec<f64>>> = factors.clone().try_into().ok()?;
        let mut at = 0;
        for rows in factors {
            let n = rows.len();
            if at + n > size || rows.iter().enumerate().any(|(i, row)| row.len() != i + 1) {
                return None;
            }
            let lower = DMatrix::from_fn(n, n, |i, j| rows[i].get(j).copied().unwrap_or(0.0));
            whole.view_mut((at, at), (n, n)).copy_from(&(&lower * lower.transpose()));
            at += n;
        }
        return (at == size && whole.iter().all(|value| value.is_finite())).then_some(whole);
    }
    let rows: Vec<Vec<f64>> = table.get("covariance")?.clone().try_into().ok()?;
    if rows.len() != size || rows.iter().any(|row| row.len() != size) {
        return None;
    }
    whole = DMatrix::from_fn(size, size, |i, j| rows[i][j]);
    whole.iter().all(|value| value.is_finite()).then_some(whole)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A covariance of two curves that are smooth along the angle, as fitted curves are: the last numbers of their
    /// factors are small.
    fn smooth(n: usize) -> Vec<Vec<f64>> {
        let of = |i: usize, j: usize| {
            let apart = (i as f64 - j as f64).abs() / 6.0;
            let same = (i < n / 3) == (j < n / 3);
            if same { 1e-10 * ((1.0 + apart) * (-apart).exp() + if i == j { 1e-4 } else { 0.0 }) } else { 0.0 }
        };
        (0..n).map(|i| (0..n).map(|j| of(i, j)).collect()).collect()
    }

    #[test]
    fn many_parameters_come_back_from_factors() {
        let covariance = smooth(90);
        let table = table(&Uncertainty::Own(covariance.clone()));
        let sizes: Vec<usize> =
            table["factors"].as_array().unwrap().iter().map(|b| b.as_array().unwrap().len()).collect();
        assert_eq!(sizes, [30, 60]);
        let back = read(&toml::Value::Table(table), 90).unwrap();
        // A command depends on many parameters. Differences of neighbours are the hardest to reproduce.
        for i in 0..89 {
            let spread = |of: &dyn Fn(usize, usize) -> f64| of(i, i) + of(i + 1, i + 1) - 2.0 * of(i, i + 1);
            let (now, then) = (spread(&|a, b| back[(a, b)]), spread(&|a, b| covariance[a][b]));
            assert!((now / then - 1.0).abs() < 2e-4, "{i}: {now} {then}");
        }
    }

    #[test]
    fn few_parameters_and_older_files_have_the_matrix_itself() {
        let covariance = smooth(12);
        let table = table(&Uncertainty::Own(covariance.clone()));
        let back = read(&toml::Value::Table(table), 12).unwrap();
        assert!((0..12).all(|i| (0..12).all(|j| back[(i, j)].to_bits() == covariance[i][j].to_bits())));
    }

    #[test]
    fn other_sizes_are_none() {
        let table = toml::Value::Table(table(&Uncertainty::Own(smooth(90))));
        assert!(read(&table, 89).is_none() && read(&table, 91).is_none());
        let short: toml::Table = toml::from_str("factors = [[[1.0], [2.0]]]").unwrap();
        assert!(read(&toml::Value::Table(short), 2).is_none());
    }
}
