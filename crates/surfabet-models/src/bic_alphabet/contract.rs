//! A BIC alphabet with its occurrences as a model like the others.

use surfabet_entropy::Coder;

use super::model::{BicAlphabet, BicAlphabetHeader, BicAlphabetModel};
use super::options::BicAlphabetOptions;
use super::report::BicAlphabetFigures;
use crate::contract::{Source, SurfaceModel, exactly, own_methods};
use crate::summary::Summary;

/// Memory that a point of a word takes.
const BYTES_PER_POINT: u64 = 8;

impl SurfaceModel for BicAlphabetModel {
    const METHOD: &'static str = "bic-alphabet";
    const STREAMS: usize = 2;
    const KEEPS_THICKNESS: bool = false;
    type Options = BicAlphabetOptions;
    type Header = BicAlphabetHeader;
    type Figures = Option<BicAlphabetFigures>;
    type Vocabulary = BicAlphabet;

    fn header(&self) -> BicAlphabetHeader {
        BicAlphabetHeader {
            shape: self.alphabet().shape(),
            n_words: self.alphabet().len() as u32,
            n_occurrences: self.len() as u64,
            scene: self.header(),
        }
    }

    fn code<C: Coder>(
        source: Source<'_, Self>,
        streams: &mut [C],
    ) -> Result<Option<Self>, C::Error> {
        let [words, poses] = exactly(streams);
        match source {
            Source::Model(model) => {
                if !model.shares_vocabulary() {
                    model.alphabet().write(words)?;
                }
                model.write(poses).map(|()| None)
            }
            Source::Streams { header, vocabulary, budget } => {
                let size = |n: u64| usize::try_from(n).unwrap_or(usize::MAX);
                let alphabet = match vocabulary {
                    Some(given) => given.clone(),
                    None => {
                        let most = size(budget.most(BYTES_PER_POINT));
                        BicAlphabet::read(header.shape, header.n_words as usize, most, words)?
                    }
                };
                if (alphabet.shape(), alphabet.len() as u32) != (header.shape, header.n_words) {
                    let what = "sizes of another alphabet than the one named";
                    return Err(words.corrupt(what.into()));
                }
                let (n, shared) = (size(header.n_occurrences), vocabulary.is_some());
                Self::read(header.scene, alphabet, n, shared, poses).map(Some)
            }
        }
    }

    fn vocabulary(&self) -> Option<BicAlphabet> {
        Some(self.alphabet().clone())
    }

    fn shares_vocabulary(&self) -> bool {
        self.shares_vocabulary()
    }

    fn summary(&self) -> Summary {
        Summary::default()
            .with("words", self.alphabet().len())
            .with("occurrences", self.len())
            .with("radius (m)", self.alphabet().radius())
            .with("epsilon (m)", self.epsilon())
            .with("colour", self.has_color())
    }

    own_methods!();
}
