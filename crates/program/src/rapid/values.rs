//! The values of the variables of a state. States share the rows in which they do not differ: a copy of a state costs little, and neither do
//! comparisons and joins with a copy of which few values have changed.

use super::value::Value;
use std::rc::Rc;

/// Variables in a row.
const ROW: usize = 16;

type Row = [Option<Value>; ROW];

/// Values by the number of their variable.
#[derive(Clone, Debug, Default)]
pub(super) struct Values {
    rows: Vec<Rc<Row>>,
    count: usize,
}

impl Values {
    /// How many variables have a value.
    pub(super) fn len(&self) -> usize {
        self.count
    }

    pub(super) fn get(&self, at: usize) -> Option<&Value> {
        self.rows.get(at / ROW)?[at % ROW].as_ref()
    }

    pub(super) fn insert(&mut self, at: usize, value: Value) {
        if self.rows.len() <= at / ROW {
            self.rows.resize(at / ROW + 1, Rc::default());
        }
        let place = &mut Rc::make_mut(&mut self.rows[at / ROW])[at % ROW];
        self.count += usize::from(place.is_none());
        *place = Some(value);
    }

    /// Removes the values from this number on.
    pub(super) fn truncate(&mut self, first: usize) {
        let values_in = |row: &[Option<Value>]| row.iter().flatten().count();
        for row in self.rows.drain(first.div_ceil(ROW).min(self.rows.len())..) {
            self.count -= values_in(&row[..]);
        }
        if let Some(row) = self.rows.get_mut(first / ROW) {
            let removed = values_in(&row[first % ROW..]);
            if removed > 0 {
                Rc::make_mut(row)[first % ROW..].fill(None);
                self.count -= removed;
            }
        }
    }

    /// Variables that have a value here or there, except for those in rows that both share.
    pub(super) fn apart(&self, other: &Self) -> Vec<usize> {
        let mut apart = Vec::new();
        for at in 0..self.rows.len().max(other.rows.len()) {
            match (self.rows.get(at), other.rows.get(at)) {
                (Some(a), Some(b)) if Rc::ptr_eq(a, b) => {}
                (a, b) => {
                    let has = |row: Option<&Rc<Row>>, k: usize| row.is_some_and(|row| row[k].is_some());
                    apart.extend((0..ROW).filter(|k| has(a, *k) || has(b, *k)).map(|k| ROW * at + k));
                }
            }
        }
        apart
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(numbers: &[usize]) -> Values {
        let mut values = Values::default();
        numbers.iter().for_each(|at| values.insert(*at, Value::Bool(true)));
        values
    }

    #[test]
    fn a_change_of_a_copy_is_apart() {
        let one = values(&[1, 17, 40]);
        let mut two = one.clone();
        assert!(one.apart(&two).is_empty());
        two.insert(18, Value::Bool(false));
        two.insert(90, Value::Bool(false));
        assert_eq!(one.apart(&two), [17, 18, 90]);
        assert_eq!(two.apart(&one), [17, 18, 90]);
        assert!(one.get(18).is_none() && one.get(90).is_none() && two.get(18).is_some());
        assert_eq!((one.len(), two.len()), (3, 5));
        two.insert(18, Value::Bool(true));
        assert_eq!(two.len(), 5);
    }

    #[test]
    fn values_from_a_number_on_are_removed() {
        for (first, left) in
            [(0, &[][..]), (1, &[]), (2, &[1]), (17, &[1]), (18, &[1, 17]), (32, &[1, 17]), (99, &[1, 17, 40])]
        {
            let mut all = values(&[1, 17, 40]);
            let before = all.clone();
            all.truncate(first);
            assert_eq!((all.apart(&Values::default()), all.len()), (left.to_vec(), left.len()), "{first}");
            assert_eq!(before.apart(&Values::default()), [1, 17, 40]);
        }
    }
}
