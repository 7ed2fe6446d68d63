//! Learning an alphabet with the scene that it describes, and describing a scene by an alphabet that is given.

use rayon::prelude::*;
use surfabet_entropy::Price;
use surfabet_geom::{Neighborhood, PointCloud, Progress, estimate_normals};

use super::candidates::clusters::{clustered, nearest_words};
use super::candidates::coverage::Rasters;
use super::candidates::descriptor::Patch;
use super::candidates::{Candidate, NEAREST, Plane, planes, with_words};
use super::channels::Channels;
use super::choice::cover::{Prices, Tally, cover};
use super::coding::occurrences::{Setting, code_occurrences, code_words};
use super::model::{Alphabet, AlphabetModel, Header};
use super::options::AlphabetOptions;
use super::placement::Placement;
use super::scene::local_points::{NearPoint, near};
use super::scene::thin::thinned;
use super::scene::{Cells, Data};
use super::word::Word;
use crate::error::{Error, Result};
use crate::options::Options;
use crate::report::{Report, lost};
use crate::scans::Scene;

/// Points that a normal is fitted to.
const NORMAL_NEIGHBORS: usize = 12;

/// Smallest radius unless it is given: metres, and over the median sigma.
const LEAST_RADIUS: f64 = 0.1;
const RADIUS: f64 = 1.5;

/// Bits of an occurrence and of its word before any was said.
const FIRST_PRICE: f32 = 18.0;
const FIRST_WORD_PRICE: f32 = 3.0;

/// Passes of improving occurrences one by one.
const PASSES: usize = 2;

/// Learns an alphabet from a cloud, and the cloud's description by it.
///
/// The result depends on the points, not on their order, and not on the number of threads.
///
/// # Errors
/// [`crate::Error::InvalidParameter`] for options outside their domain, [`crate::Error::EmptyCloud`],
/// [`crate::Error::TooLarge`] when the scene has too many cells, [`crate::Error::Cancelled`].
pub fn learn(
    cloud: &PointCloud,
    options: &AlphabetOptions,
    progress: &dyn Progress,
) -> Result<AlphabetModel> {
    run(cloud, None, options, progress)
}

/// Describes a cloud by the words of `alphabet` (IV-B). Radii are those of the alphabet; the model's file names the
/// alphabet and does not hold it.
///
/// # Errors
/// As [`learn`].
pub fn describe(
    cloud: &PointCloud,
    alphabet: &Alphabet,
    options: &AlphabetOptions,
    progress: &dyn Progress,
) -> Result<AlphabetModel> {
    let (radius, scales) = (Some(alphabet.radius()), alphabet.scales());
    let options = AlphabetOptions { radius, scales, ..*options };
    run(cloud, Some(alphabet), &options, progress)
}

fn run(
    cloud: &PointCloud,
    frozen: Option<&Alphabet>,
    options: &AlphabetOptions,
    progress: &dyn Progress,
) -> Result<AlphabetModel> {
    options.check()?;
    let mut report = Report::default();
    progress.update("preparing the scene", 0.0);
    let (scene, thin, data) =
        report.time("preparing the scene", || prepared(cloud, options, progress))?;
    progress.update("finding planes", 0.1);
    let mut scales = report.time("finding planes", || {
        (0..options.scales)
            .map(|scale| {
                let cells = Cells::new(&data.points, scale);
                let planes = planes(&data, &cells, scale, options.spacing, progress)?;
                Ok(Scale { cells, planes })
            })
            .collect::<Result<Vec<Scale>>>()
    })?;
    let mut prices = Prices {
        point: options.inlier_bits() as f32,
        lone: options.outlier_bits() as f32,
        occurrence: vec![FIRST_PRICE; scales.len()],
        word: Vec::new(),
    };
    progress.update("clustering words", 0.3);
    let words = report.time("clustering words", || {
        for scale in &mut scales {
            // What cannot pay even alone is of no use.
            let points = |p: &Plane| p.candidate.coverage.points.len() as f32;
            scale.planes.retain(|p| prices.point * points(p) > FIRST_PRICE);
        }
        match frozen {
            Some(alphabet) => Ok(alphabet.words().to_vec()),
            None => {
                let all: Vec<&Patch> =
                    scales.iter().flat_map(|s| s.planes.iter().map(|p| &p.look)).collect();
                clustered(&all, options.max_words as usize, progress)
            }
        }
    })?;
    prices.word = vec![FIRST_WORD_PRICE; words.len()];
    prices.word[0] = 1.0;
    progress.update("placing words", 0.4);
    let mut candidates = report.time("placing words", || {
        let mut all: Vec<Candidate> = Vec::new();
        for Scale { cells, planes } in &scales {
            all.extend(with_words(&data, cells, planes, &words, options.spacing, progress)?);
            all.extend(planes.iter().map(|p| p.candidate.clone()));
        }
        all.retain(|c| prices.point * c.coverage.points.len() as f32 > prices.cost(c));
        all.sort_by_key(|c| c.placement);
        Ok::<_, Error>(all)
    })?;
    progress.update("choosing occurrences", 0.7);
    let start = std::time::Instant::now();
    let mut search = Search {
        data: &data,
        scales: &scales,
        options,
        setting: Setting {
            scales: options.scales,
            rule: data.rule,
            sensors: data.sensors.clone(),
            n_words: words.len() as u32,
        },
        words,
        frozen: frozen.is_some(),
        prices,
        costs: Vec::new(),
    };
    let chosen = search.choose(&mut candidates, progress)?;
    report.add_time("choosing occurrences", start.elapsed().as_secs_f64());
    report.iterations = search.costs.len();
    report.objectives.push(("bits, misfit included".into(), search.costs.clone()));
    report.stop_reason = "every round was run";
    // Ranges follow from the sensors' places.
    let kept: &[&str] = if data.sensors.is_empty() {
        &["colors", "intensities"]
    } else {
        &["colors", "intensities", "ranges", "viewpoints"]
    };
    report.not_kept = lost(cloud, kept);
    report.figures.extend([
        ("points", cloud.len() as f64),
        ("distinct points", scene.len() as f64),
        ("points as dense as sigma asks", data.points.len() as f64),
        ("duplicates", scene.duplicates as f64),
        ("points too near", scene.too_near as f64),
        ("candidates", candidates.len() as f64),
    ]);
    let header = Header {
        n_points: cloud.len() as u64,
        origin: data.origin,
        spacing: options.spacing,
        deviation: scene.deviation,
        rule: data.rule,
        sensors: data.sensors.clone(),
    };
    let alphabet = match frozen {
        Some(alphabet) => alphabet.clone(),
        None => Alphabet::new(data.radius(), options.scales, search.words)?,
    };
    let channels = Channels::of(&thin, options.color_step);
    let means = |c: &Candidate| (c.placement, channels.means(&thin, &c.coverage.points));
    let placed = chosen.iter().map(means).collect();
    let mut model = AlphabetModel::new(header, alphabet, placed, channels, frozen.is_some())?;
    *model.report_mut() = report;
    Ok(model)
}

/// The scene, what of it the words are fitted to, and that in units.
fn prepared(
    cloud: &PointCloud,
    options: &AlphabetOptions,
    progress: &dyn Progress,
) -> Result<(Scene, Scene, Data)> {
    let scene = Scene::new(cloud, options.deviation(), options.min_range, progress)?;
    progress.check()?;
    let kept = thinned(&scene);
    progress.check()?;
    let thin = scene.select(&kept);
    let (points, _) = PointCloud::from_positions(thin.positions.clone());
    let near = Neighborhood::Nearest(NORMAL_NEIGHBORS);
    let normals = estimate_normals(&points, near, progress)?.normals;
    let radius = options.radius.unwrap_or_else(|| LEAST_RADIUS.max(RADIUS * scene.median_sigma()));
    progress.check()?;
    let data = Data::new(&thin, normals, radius)?;
    Ok((scene, thin, data))
}

struct Scale {
    cells: Cells,
    planes: Vec<Plane>,
}

struct Search<'a> {
    data: &'a Data,
    scales: &'a [Scale],
    options: &'a AlphabetOptions,
    setting: Setting,
    words: Vec<Word>,
    frozen: bool,
    prices: Prices,
    /// Bits of every round, with what is not explained.
    costs: Vec<f64>,
}

impl Search<'_> {
    /// Chooses occurrences with prices that follow what the coder spends, drops words that do not pay, and improves
    /// occurrences one by one.
    fn choose(
        &mut self,
        candidates: &mut Vec<Candidate>,
        progress: &dyn Progress,
    ) -> Result<Vec<Candidate>> {
        for _ in 0..self.options.rounds {
            progress.check()?;
            let (mut chosen, tally) = self.covered(candidates, progress)?;
            self.learn_prices(&chosen, &tally);
            if !self.frozen {
                let paying = self.paying(candidates, &chosen, &tally);
                self.keep_words(&paying, candidates, &mut chosen);
            }
        }
        let (mut chosen, mut tally) = self.covered(candidates, progress)?;
        for _ in 0..PASSES {
            progress.check()?;
            self.improve(&mut chosen, &mut tally, progress)?;
            self.learn_prices(&chosen, &tally);
        }
        chosen.retain(|c| {
            let pays = self.prices.point * tally.count(&c.coverage.points, 1) > self.prices.cost(c);
            if !pays {
                tally.remove(&c.coverage.points);
            }
            pays
        });
        // Steps of neighbouring poses can meet.
        chosen.sort_by_key(|c| c.placement);
        chosen.dedup_by_key(|c| c.placement);
        if !self.frozen {
            let used: Vec<bool> = self.used(&chosen).iter().map(|&n| n > 0).collect();
            self.keep_words(&used, candidates, &mut chosen);
        }
        self.learn_prices(&chosen, &tally);
        Ok(chosen)
    }

    fn covered(
        &self,
        candidates: &[Candidate],
        progress: &dyn Progress,
    ) -> Result<(Vec<Candidate>, Tally)> {
        let (chosen, tally) = cover(candidates, &self.prices, self.data.points.len(), progress)?;
        Ok((chosen.iter().map(|&k| candidates[k as usize].clone()).collect(), tally))
    }

    /// What occurrences and words really take, and the length of the whole description.
    fn learn_prices(&mut self, chosen: &[Candidate], tally: &Tally) {
        let placements: Vec<Placement> = chosen.iter().map(|c| c.placement).collect();
        let mut taken = vec![(0.0, 0_u32); self.scales.len()];
        let mut before = 0.0;
        let mut price = Price::default();
        let mut mark = |price: &Price, p: &Placement| {
            let (bits, n) = &mut taken[usize::from(p.scale)];
            *bits += price.bits - before;
            *n += 1;
            before = price.bits;
        };
        let Ok(_) = code_occurrences(&mut price, &self.setting, &placements, usize::MAX, &mut mark);
        let used = self.used(chosen);
        let all = placements.len().max(1) as f32;
        // The coder's own prices hold the word's share; half a use more for every word keeps them finite.
        let of_word = |&n: &usize| (all / (n as f32 + 0.5)).log2();
        self.prices.word = used.iter().map(of_word).collect();
        let mean =
            placements.iter().map(|p| self.prices.word[usize::from(p.word)]).sum::<f32>() / all;
        for (kept, (bits, n)) in self.prices.occurrence.iter_mut().zip(taken) {
            if n > 0 {
                *kept = (bits / f64::from(n)) as f32 - mean;
            }
        }
        let Ok(_) = code_words(&mut price, self.words.len() - 1, &self.words[1..]);
        let lone: f32 = chosen.iter().map(|c| c.coverage.lone as f32).sum();
        let misfit = self.prices.point * tally.unexplained() + self.prices.lone * lone;
        self.costs.push(price.bits + f64::from(misfit));
    }

    fn used(&self, chosen: &[Candidate]) -> Vec<usize> {
        let mut used = vec![0; self.words.len()];
        chosen.iter().for_each(|c| used[usize::from(c.placement.word)] += 1);
        used
    }

    /// The words that save more than their bits, against a plane in the same places.
    fn paying(&self, candidates: &[Candidate], chosen: &[Candidate], tally: &Tally) -> Vec<bool> {
        let mut saved = vec![0.0; self.words.len()];
        for c in chosen {
            let plain = Placement { word: 0, ..c.placement };
            let plane = candidates.binary_search_by_key(&plain, |c| c.placement);
            // Without the occurrence, its points are lost; with a plane in its stead, some of them.
            let with = self.prices.point * tally.count(&c.coverage.points, 1) - self.prices.cost(c);
            let without = plane.ok().map_or(0.0, |k| {
                let plane = &candidates[k];
                let shared = c
                    .coverage
                    .points
                    .iter()
                    .filter(|&&i| plane.coverage.points.binary_search(&i).is_ok());
                let shared: Vec<u32> = shared.copied().collect();
                let kept = tally.count(&shared, 1) + tally.count(&plane.coverage.points, 0);
                (self.prices.point * kept - self.prices.cost(plane)).max(0.0)
            });
            saved[usize::from(c.placement.word)] += with - without;
        }
        let price_of = |word: &Word| {
            let mut price = Price::default();
            let Ok(_) = code_words(&mut price, 1, std::slice::from_ref(word));
            price.bits as f32
        };
        self.words.iter().zip(&saved).map(|(word, &saved)| saved >= price_of(word)).collect()
    }

    /// Keeps these words and the plane, the most frequent first, and what is made of them.
    fn keep_words(
        &mut self,
        keep: &[bool],
        candidates: &mut Vec<Candidate>,
        chosen: &mut Vec<Candidate>,
    ) {
        let used = self.used(chosen);
        let mut order: Vec<usize> = (1..self.words.len()).filter(|&k| keep[k]).collect();
        order.sort_by_key(|&k| (std::cmp::Reverse(used[k]), k));
        order.insert(0, 0);
        let mut renamed = vec![None; self.words.len()];
        for (new, &old) in order.iter().enumerate() {
            renamed[old] = Some(new as u16);
        }
        let rename = |all: &mut Vec<Candidate>| {
            all.retain(|c| renamed[usize::from(c.placement.word)].is_some());
            for c in all.iter_mut() {
                c.placement.word = renamed[usize::from(c.placement.word)].unwrap_or(0);
            }
            all.sort_by_key(|c| c.placement);
        };
        rename(candidates);
        rename(chosen);
        self.words = order.iter().map(|&k| self.words[k].clone()).collect();
        self.prices.word = order.iter().map(|&k| self.prices.word[k]).collect();
        self.setting.n_words = self.words.len() as u32;
    }

    /// Takes every occurrence out in turn and puts the best of its variants back: a step of its pose, another word.
    fn improve(
        &self,
        chosen: &mut [Candidate],
        tally: &mut Tally,
        progress: &dyn Progress,
    ) -> Result<()> {
        let known: Vec<Patch> = self.words.iter().map(Patch::of_word).collect();
        let variants: Vec<Vec<Candidate>> = chosen
            .par_iter()
            .map_init(
                || (Vec::new(), Vec::new(), Rasters::new(&self.words)),
                |(around, close, rasters), c| {
                    progress.check()?;
                    Ok(self.variants(c, &known, around, close, rasters))
                },
            )
            .collect::<Result<_>>()?;
        for (c, variants) in chosen.iter_mut().zip(variants) {
            progress.check()?;
            tally.remove(&c.coverage.points);
            let gain = |c: &Candidate| {
                self.prices.point * tally.count(&c.coverage.points, 0) - self.prices.cost(c)
            };
            let mut best = gain(c);
            for variant in variants {
                let gain = gain(&variant);
                if gain > best {
                    best = gain;
                    *c = variant;
                }
            }
            tally.add(&c.coverage.points);
        }
        Ok(())
    }

    fn variants(
        &self,
        c: &Candidate,
        known: &[Patch],
        around: &mut Vec<u32>,
        close: &mut Vec<NearPoint>,
        rasters: &mut Rasters<'_>,
    ) -> Vec<Candidate> {
        let p = c.placement;
        let cells = &self.scales[usize::from(p.scale)].cells;
        cells.touched(p.cell, &c.stand, u32::from(p.scale), around);
        let mut poses = Vec::new();
        for step in [-1, 1] {
            poses.push(Placement { offset: p.offset + step, ..p });
            for a in 0..2 {
                let mut slopes = p.slopes;
                slopes[a] += step as i16;
                poses.push(Placement { slopes, ..p });
            }
        }
        poses.retain(|p| p.slopes_fit(c.stand.level));
        near(self.data, &c.stand, around, close);
        // A step of the pose moves nothing far: what is not near now will not be.
        around.clear();
        around.extend(close.iter().map(|p| p.index));
        let fitting = nearest_words(&Patch::of(&c.stand, close), known, NEAREST);
        let words = fitting.into_iter().map(|word| word as u16).filter(|&word| word != p.word);
        poses.extend(words.map(|word| Placement { word, ..p }));
        poses
            .into_iter()
            .map(|placement| {
                let stand = placement.stand(c.stand.level, self.data.sensor(placement.view));
                near(self.data, &stand, around, close);
                let word = usize::from(placement.word);
                let coverage = rasters.coverage(word, &stand, self.options.spacing, close);
                Candidate { placement, stand, coverage }
            })
            .collect()
    }
}
