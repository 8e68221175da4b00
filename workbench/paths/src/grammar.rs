// SPDX-License-Identifier: GPL-2.0-or-later
//! The grammar of expressions.

use winnow::ascii::{alpha1, float, multispace0};
use winnow::combinator::{
    Infix, Prefix, alt, cut_err, delimited, dispatch, expression, fail, opt, peek, preceded,
    separated,
};
use winnow::error::{ContextError, StrContext, StrContextValue};
use winnow::prelude::*;
use winnow::token::{any, one_of, take_while};

pub(super) const FUNCTIONS: [(&str, Unary); 13] = [
    ("sin", Unary::Sin),
    ("cos", Unary::Cos),
    ("tan", Unary::Tan),
    ("asin", Unary::Asin),
    ("acos", Unary::Acos),
    ("atan", Unary::Atan),
    ("sinh", Unary::Sinh),
    ("cosh", Unary::Cosh),
    ("tanh", Unary::Tanh),
    ("asinh", Unary::Asinh),
    ("exp", Unary::Exp),
    ("ln", Unary::Ln),
    ("sqrt", Unary::Sqrt),
];

/// Limits of nesting and length, which bound the stack.
const DEEPEST: usize = 64;
const LONGEST: usize = 1000;
/// Operators and functions of one argument.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Unary {
    Negative,
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Sinh,
    Cosh,
    Tanh,
    Asinh,
    Exp,
    Ln,
    Sqrt,
}

/// Operators and functions of two arguments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Binary {
    Plus,
    Minus,
    Times,
    Over,
    Power,
    Angle,
}

/// A syntax tree; after parsing, names are not yet resolved.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Tree {
    Number(f64),
    Name(String),
    Slot(usize),
    Unary(Unary, Box<Tree>),
    Binary(Binary, Box<Tree>, Box<Tree>),
}

/// Parses a whole expression; on a syntax error returns the byte and what was expected there.
pub(super) fn parse(text: &str) -> Result<Tree, (usize, String)> {
    if let Some(excess) = too_much(text) {
        return Err(excess);
    }
    let whole = delimited(multispace0, sum, multispace0);
    { whole }.parse(text).map_err(|error| {
        let expected = error.inner().to_string();
        let expected = if expected.is_empty() { "expected an operator".into() } else { expected };
        (error.offset(), expected.replace('\n', "; "))
    })
}

/// Returns the position and the limit, if an expression is too long or its parentheses are nested too deep.
fn too_much(text: &str) -> Option<(usize, String)> {
    if text.len() > LONGEST {
        return Some((0, format!("more than {LONGEST} characters")));
    }
    let mut depth = 0_usize;
    let deep = text.char_indices().find(|(_, c)| {
        match c {
            '(' => depth += 1,
            ')' => depth = depth.saturating_sub(1),
            _ => {}
        }
        depth > DEEPEST
    });
    deep.map(|(at, _)| (at, format!("more than {DEEPEST} nested parentheses")))
}

type Input<'a> = &'a str;

const OPERAND: StrContextValue = StrContextValue::Description("a number, a name or (");

fn sum(input: &mut Input) -> ModalResult<Tree> {
    expression(spaced(operand))
        .prefix(spaced(
            // The lookahead keeps the position of a failure.
            preceded(
                peek(one_of(['-', '+'])),
                dispatch! {any;
                    '-' => Prefix(6, |_: &mut _, a| Ok(Tree::Unary(Unary::Negative, Box::new(a)))),
                    '+' => Prefix(6, |_: &mut _, a| Ok(a)),
                    _ => fail,
                },
            )
            .context(StrContext::Expected(OPERAND)),
        ))
        .infix(spaced(dispatch! {any;
            '+' => Infix::Left(3, |_: &mut _, a, b| Ok(both(Binary::Plus, a, b))),
            '-' => Infix::Left(3, |_: &mut _, a, b| Ok(both(Binary::Minus, a, b))),
            '*' => Infix::Left(5, |_: &mut _, a, b| Ok(both(Binary::Times, a, b))),
            '/' => Infix::Left(5, |_: &mut _, a, b| Ok(both(Binary::Over, a, b))),
            '^' => Infix::Right(9, |_: &mut _, a, b| Ok(both(Binary::Power, a, b))),
            _ => fail,
        }))
        .parse_next(input)
}

fn both(operator: Binary, a: Tree, b: Tree) -> Tree {
    Tree::Binary(operator, Box::new(a), Box::new(b))
}

/// Skips blanks before a parser.
fn spaced<'a, T>(
    parser: impl ModalParser<Input<'a>, T, ContextError>,
) -> impl ModalParser<Input<'a>, T, ContextError> {
    preceded(multispace0, parser)
}

fn operand(input: &mut Input) -> ModalResult<Tree> {
    let number = preceded(peek(any.verify(char::is_ascii_digit)), float);
    alt((number.map(Tree::Number), call_or_name, in_parentheses)).parse_next(input)
}

fn in_parentheses(input: &mut Input) -> ModalResult<Tree> {
    preceded('(', cut_err((sum, spaced(')')).map(|(tree, _)| tree)))
        .context(StrContext::Expected(StrContextValue::CharLiteral(')')))
        .parse_next(input)
}

fn call_or_name(input: &mut Input) -> ModalResult<Tree> {
    let word = (alpha1, take_while(0.., |c: char| c.is_ascii_alphanumeric() || c == '_'));
    let name = word.take().parse_next(input)?.to_string();
    let arguments = separated(1..=2, sum, spaced(','));
    let arguments = preceded(spaced('('), cut_err((arguments, spaced(')')).map(|(list, _)| list)));
    let arguments: Option<Vec<Tree>> = opt(arguments).parse_next(input)?;
    let function = FUNCTIONS.iter().find(|(own, _)| *own == name).map(|(_, function)| *function);
    match (function, arguments) {
        (Some(function), Some(mut list)) if list.len() == 1 => {
            Ok(Tree::Unary(function, Box::new(list.remove(0))))
        }
        (None, Some(mut list)) if name == "atan2" && list.len() == 2 => {
            let x = list.remove(1);
            Ok(both(Binary::Angle, list.remove(0), x))
        }
        (None, None) => Ok(Tree::Name(name)),
        _ => cut_err(fail)
            .context(StrContext::Expected(StrContextValue::Description(
                "a known function with its arguments, such as sin(t) or atan2(y, x)",
            )))
            .parse_next(input),
    }
}
