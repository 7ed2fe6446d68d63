//! An alphabet with its occurrences as a model like the others.

use surfabet_entropy::Coder;

use super::learn::AlphabetFigures;
use super::model::{Alphabet, AlphabetHeader, AlphabetModel};
use super::options::AlphabetOptions;
use crate::contract::{Source, SurfaceModel, exactly, own_methods};
use crate::summary::Summary;

impl SurfaceModel for AlphabetModel {
    const METHOD: &'static str = "alphabet";
    const STREAMS: usize = 3;
    const KEEPS_THICKNESS: bool = false;
    type Options = AlphabetOptions;
    type Header = AlphabetHeader;
    type Figures = Option<AlphabetFigures>;
    type Vocabulary = Alphabet;

    fn header(&self) -> AlphabetHeader {
        AlphabetHeader {
            radius: self.alphabet().radius(),
            scales: self.alphabet().scales(),
            n_words: self.alphabet().words().len() as u32,
            n_occurrences: self.len() as u64,
            channels: self.attributes().map(|a| a.channels).unwrap_or_default(),
            scene: self.header().clone(),
        }
    }

    fn code<C: Coder>(
        source: Source<'_, Self>,
        streams: &mut [C],
    ) -> Result<Option<Self>, C::Error> {
        let [words, occurrences, channels] = exactly(streams);
        match source {
            Source::Model(model) => {
                if !model.shares_vocabulary() {
                    model.alphabet().code(words, model.alphabet().words().len())?;
                }
                model.write(occurrences, channels).map(|()| None)
            }
            Source::Streams { header, vocabulary, .. } => {
                let alphabet = match vocabulary {
                    Some(given) => given.clone(),
                    None => Alphabet::read(header, words)?,
                };
                let sizes = (alphabet.radius(), alphabet.scales(), alphabet.words().len() as u32);
                if sizes != (header.radius, header.scales, header.n_words) {
                    return Err(words.corrupt("sizes of another alphabet".into()));
                }
                let n = usize::try_from(header.n_occurrences).unwrap_or(usize::MAX);
                let (scene, kept) = (header.scene.clone(), header.channels);
                let shared = vocabulary.is_some();
                Self::read(scene, alphabet, n, kept, shared, occurrences, channels).map(Some)
            }
        }
    }

    fn vocabulary(&self) -> Option<Alphabet> {
        Some(self.alphabet().clone())
    }

    fn shares_vocabulary(&self) -> bool {
        self.shares_vocabulary()
    }

    fn summary(&self) -> Summary {
        let alphabet = self.alphabet();
        let radii = (0..alphabet.scales()).map(|s| alphabet.radius() * f64::from(1_u32 << s));
        let radii: Vec<String> = radii.map(|radius| format!("{radius:.4}")).collect();
        let deviation = self.header().deviation;
        let summary = Summary::default()
            .with("words", alphabet.words().len())
            .with("occurrences", self.len())
            .with("radii (m)", radii.join(" "))
            .with("colour", self.has_color())
            .with("intensity", self.has_intensity());
        let summary = match deviation.angular_resolution {
            Some(angle) => summary
                .with("sigma scale", deviation.sigma_scale)
                .with("angular resolution (degrees)", angle.to_degrees()),
            None => summary.with("sigma (m)", self.constant_sigma()),
        };
        summary.with("noise (m)", deviation.noise.unwrap_or(0.0))
    }

    own_methods!();
}
