//! The records of options of all methods: learning refuses what is out of range, and says which option it is.

use std::ops::Bound;

use surfabet::options::{Kind, OptionSpec, Options, Value};
use surfabet::{PointCloud, Silent, alphabet, bic_alphabet, gas, hscsm, patches, planes};
use surfabet_models::{Error, Result};

/// Values just outside the range.
fn outside(spec: &OptionSpec) -> Vec<Value> {
    let number = |value: f64| match spec.kind {
        Kind::Int => Value::Int(value as i128),
        Kind::Floats => Value::Floats(vec![value]),
        _ => Value::Float(value),
    };
    let beyond = |value: f64, towards: f64| match spec.kind {
        Kind::Int => value + towards,
        _ => value + towards * value.abs().max(1.0) * 1e-9,
    };
    let mut values = match spec.range.low {
        Bound::Included(low) => vec![number(beyond(low, -1.0))],
        Bound::Excluded(low) => vec![number(low)],
        Bound::Unbounded => vec![],
    };
    match (spec.kind, spec.range.high) {
        (Kind::Bool | Kind::Texts | Kind::Choice(_), _) => return vec![],
        (_, Bound::Included(high)) if high.is_finite() => values.push(number(beyond(high, 1.0))),
        (_, Bound::Excluded(high)) => values.push(number(high)),
        (Kind::Float, Bound::Unbounded) => values.push(number(f64::INFINITY)),
        _ => {}
    }
    if spec.kind != Kind::Int {
        values.push(number(f64::NAN));
    }
    values
}

/// Tries every option of a method with values outside its range.
fn refused<O: Options>(learn: impl Fn(&PointCloud, &O) -> Result<()>) {
    let (cloud, _) = PointCloud::from_positions(vec![[0.0; 3], [1.0; 3], [0.0, 1.0, 0.0]]);
    assert_eq!(O::default().check(), Ok(()));
    let mut tried = 0;
    for spec in O::SPECS {
        for value in outside(spec) {
            let mut options = O::default();
            let found = options.set(spec.name, &value).and_then(|()| learn(&cloud, &options));
            match found {
                Err(Error::InvalidParameter(found)) => {
                    assert_eq!(found.name, spec.name);
                    assert_eq!(found.requirement, spec.requirement());
                }
                other => panic!("{} = {value}: {other:?}", spec.name),
            }
            tried += 1;
        }
    }
    assert!(tried > O::SPECS.len(), "{tried}");
}

#[test]
fn patches_refuse_what_is_out_of_range() {
    refused(|cloud, options| patches::learn(cloud, options, &Silent).map(|_| ()));
}

#[test]
fn hscsm_refuses_what_is_out_of_range() {
    refused(|cloud, options| hscsm::learn(cloud, options, &Silent).map(|_| ()));
}

#[test]
fn alphabets_refuse_what_is_out_of_range() {
    refused(|cloud, options| alphabet::learn(cloud, options, &Silent).map(|_| ()));
}

#[test]
fn bic_alphabets_refuse_what_is_out_of_range() {
    refused(|cloud, options| bic_alphabet::learn(cloud, options, &Silent).map(|_| ()));
}

#[test]
fn planes_refuse_what_is_out_of_range() {
    refused(|cloud, options| planes::learn(cloud, None, options, &Silent).map(|_| ()));
}

#[test]
fn gases_refuse_what_is_out_of_range() {
    refused(|cloud, options| gas::learn(cloud, options, &Silent).map(|_| ()));
}
