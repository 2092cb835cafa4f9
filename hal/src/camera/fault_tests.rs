use super::*;

const WIDTH: usize = 24;
const HEIGHT: usize = 10;

/// Delivers pairs in which every pixel tells side, pair and place.
struct Plain {
    pairs: u32,
    next: u32,
    size: (usize, usize),
    odd: bool,
}

fn pixel(right: bool, pair: u32, x: usize, y: usize) -> u8 {
    (64 + usize::from(right) * 50 + 7 * pair as usize + 3 * x + 11 * y) as u8 % 128 + 64
}

fn picture(right: bool, pair: u32, (width, height): (usize, usize)) -> Vec<u8> {
    (0..height).flat_map(|y| (0..width).map(move |x| pixel(right, pair, x, y))).collect()
}

impl Camera for Plain {
    type Error = core::convert::Infallible;

    fn next_pair<R>(&mut self, consume: impl FnOnce(&StereoPair<'_>) -> R) -> Result<Option<R>, Self::Error> {
        if self.next == self.pairs {
            return Ok(None);
        }
        let sequence = self.next;
        self.next += 1;
        let (left, right) = (picture(false, sequence, self.size), picture(true, sequence, self.size));
        let view = |pixels| Picture::packed(pixels, self.size.0, self.size.1).unwrap();
        let pair = StereoPair {
            left: view(&left),
            right: view(&right),
            timestamp_ns: 1_000 * u64::from(sequence),
            skew_ns: 5,
            sequence,
            missed: 0,
        };
        Ok(Some(consume(&pair)))
    }

    fn take_warning(&mut self) -> Option<String> {
        std::mem::take(&mut self.odd).then(|| "odd".to_owned())
    }
}

#[test]
fn warnings_pass_through_whatever_is_in_front_of_the_camera() {
    let plain = Plain { pairs: 4, next: 2, size: (WIDTH, HEIGHT), odd: true };
    let paced = crate::camera::PacedCamera::new(plain, None);
    let mut camera = FaultyCamera::new(paced, (WIDTH, HEIGHT), 0, 1);
    assert_eq!(camera.take_warning().as_deref(), Some("odd"));
    assert_eq!(camera.take_warning(), None);
}

#[derive(Clone, Debug, PartialEq, Eq)]
struct Seen {
    left: Vec<u8>,
    right: Vec<u8>,
    timestamp_ns: u64,
    sequence: u32,
    missed: u32,
}

fn camera(pairs: u32) -> FaultyCamera<Plain> {
    FaultyCamera::new(Plain { pairs, next: 0, size: (WIDTH, HEIGHT), odd: false }, (WIDTH, HEIGHT), 3, 42)
}

fn next(camera: &mut FaultyCamera<Plain>) -> Result<Option<Seen>, CameraErrorKind> {
    let pixels = |picture: &Picture<'_>| (0..picture.height()).flat_map(|y| picture.row(y).to_vec()).collect();
    let seen = camera.next_pair(|pair| Seen {
        left: pixels(&pair.left),
        right: pixels(&pair.right),
        timestamp_ns: pair.timestamp_ns,
        sequence: pair.sequence,
        missed: pair.missed,
    });
    seen.map_err(|error| error.kind())
}

fn truth(pair: u32) -> Seen {
    let size = (WIDTH, HEIGHT);
    Seen {
        left: picture(false, pair, size),
        right: picture(true, pair, size),
        timestamp_ns: 1_000 * u64::from(pair),
        sequence: pair,
        missed: 0,
    }
}

#[test]
fn without_faults_everything_passes() {
    let mut camera = camera(6);
    for pair in 0..6 {
        assert_eq!(next(&mut camera), Ok(Some(truth(pair))));
    }
    assert_eq!(next(&mut camera), Ok(None));
    assert_eq!(camera.counts(), FaultyCounts { pairs: 6, ..FaultyCounts::default() });
}

#[test]
fn errors_last_as_many_calls_as_were_set_and_time_goes_on_meanwhile() {
    let mut camera = camera(20);
    assert_eq!(next(&mut camera), Ok(Some(truth(0))));
    camera.set_stall(3);
    camera.set_lost(2);
    camera.set_damaged(1);
    let kinds: Vec<_> = (0..6).map(|_| next(&mut camera).unwrap_err()).collect();
    use CameraErrorKind::{Damaged, Lost, NoPicture};
    assert_eq!(kinds, [NoPicture, NoPicture, NoPicture, Lost, Lost, Damaged]);
    assert_eq!(next(&mut camera), Ok(Some(truth(7))), "six pairs have gone by");
    let FaultyCounts { pairs, stalled, lost, damaged, .. } = camera.counts();
    assert_eq!((pairs, stalled, lost, damaged), (2, 3, 2, 1));
}

#[test]
fn chances_are_met_as_often_as_they_say_and_repeat_with_the_seed() {
    let run = |seed| {
        let plain = Plain { pairs: 3000, next: 0, size: (4, 2), odd: false };
        let mut camera = FaultyCamera::new(plain, (4, 2), 0, seed);
        camera.set_drop_chance(20);
        camera.set_damage_chance(10);
        let mut seen = Vec::new();
        loop {
            match camera.next_pair(|pair| (pair.sequence, pair.missed)) {
                Ok(Some(pair)) => seen.push(pair),
                Ok(None) => return (seen, camera.counts()),
                Err(error) => assert_eq!(error.kind(), CameraErrorKind::Damaged),
            }
        }
    };
    let (seen, counts) = run(7);
    println!("seed 7: {counts:?}");
    assert!(counts.dropped.abs_diff(600) < 150 && counts.damaged.abs_diff(300) < 90);
    assert_eq!(seen.len() as u64, counts.pairs);
    let missed: u64 = seen.iter().map(|(_, missed)| u64::from(*missed)).sum();
    assert!(missed.abs_diff(2 * counts.dropped) <= 200, "those dropped at the very end are not told any more");
    assert!(seen.is_sorted());
    assert_eq!(run(7), run(7));
    assert_ne!(run(7).0, run(8).0);
}

#[test]
fn dropping_all_pairs_ends() {
    let mut camera = camera(500);
    camera.set_drop_chance(100);
    let pair = next(&mut camera).unwrap().unwrap();
    assert_eq!((pair.sequence, pair.missed), (MOST_DROPPED, 2 * MOST_DROPPED));
}

#[test]
fn frozen_pictures_stay_while_times_go_on() {
    for sides in [Sides::Left, Sides::Right, Sides::Both] {
        let mut camera = camera(6);
        for _ in 0..3 {
            next(&mut camera).unwrap();
        }
        camera.set_frozen(sides);
        for pair in 3..6 {
            let seen = next(&mut camera).unwrap().unwrap();
            let shown = |frozen: bool| truth(if frozen { 2 } else { pair });
            assert_eq!(seen.left, shown(sides.left()).left);
            assert_eq!(seen.right, shown(sides.right()).right);
            assert_eq!(seen.timestamp_ns, truth(pair).timestamp_ns);
        }
    }
}

#[test]
fn light_and_cover_change_the_sides_that_were_set_and_no_other() {
    type Set = fn(&mut FaultyCamera<Plain>, Sides);
    type Holds = fn(usize, u8, u8) -> bool;
    let faults: [(Set, Holds); 4] = [
        (|camera, sides| camera.set_dark(sides), |_, seen, truth| seen == truth / 32),
        (|camera, sides| camera.set_saturated(sides), |_, seen, _| seen == 255),
        (|camera, sides| camera.set_covered(sides, 100), |_, seen, _| (COVERED_GREY..COVERED_GREY + 4).contains(&seen)),
        (
            |camera, sides| camera.set_covered(sides, 50),
            |x, seen, truth| {
                if x < WIDTH / 2 { (COVERED_GREY..COVERED_GREY + 4).contains(&seen) } else { seen == truth }
            },
        ),
    ];
    for (set, holds) in faults {
        for sides in [Sides::Left, Sides::Right, Sides::Both] {
            let mut camera = camera(3);
            set(&mut camera, sides);
            let seen = next(&mut camera).unwrap().unwrap();
            for (seen, truth, spoilt) in
                [(&seen.left, truth(0).left, sides.left()), (&seen.right, truth(0).right, sides.right())]
            {
                if spoilt {
                    let all = seen.iter().zip(&truth).enumerate();
                    assert!(all.into_iter().all(|(at, (seen, truth))| holds(at % WIDTH, *seen, *truth)), "{sides:?}");
                } else {
                    assert_eq!(*seen, truth);
                }
            }
            assert_eq!(camera.counts().spoilt, 1);
            camera.heal();
            assert_eq!(next(&mut camera), Ok(Some(truth(1))));
        }
    }
}

#[test]
fn the_right_picture_lags_shifts_or_takes_the_place_of_the_left_one() {
    let mut lagging = camera(10);
    lagging.set_right_lag(2);
    for pair in 0..6 {
        let seen = next(&mut lagging).unwrap().unwrap();
        assert_eq!((seen.left, seen.timestamp_ns), (truth(pair).left, truth(pair).timestamp_ns));
        if pair >= 2 {
            assert_eq!(seen.right, truth(pair - 2).right);
        }
    }
    lagging.set_right_lag(99);
    assert_eq!(next(&mut lagging).unwrap().unwrap().right, truth(3).right, "three is what it was made for");

    for shift in [-3, 2, 100] {
        let mut shifted = camera(1);
        shifted.set_row_shift(shift);
        let seen = next(&mut shifted).unwrap().unwrap();
        for y in 0..HEIGHT {
            let from = (y as i32 - shift).clamp(0, HEIGHT as i32 - 1) as usize;
            assert_eq!(seen.right[y * WIDTH..][..WIDTH], truth(0).right[from * WIDTH..][..WIDTH], "row {y}");
        }
        assert_eq!(seen.left, truth(0).left);
    }

    let mut exchanged = camera(1);
    exchanged.set_exchanged(true);
    let seen = next(&mut exchanged).unwrap().unwrap();
    assert_eq!((seen.left, seen.right), (truth(0).right, truth(0).left));
}

#[test]
fn times_jump_and_go_round() {
    let mut camera = camera(3);
    camera.set_time_offset(-500);
    assert_eq!(next(&mut camera).unwrap().unwrap().timestamp_ns, u64::MAX - 499);
    assert_eq!(next(&mut camera).unwrap().unwrap().timestamp_ns, 500);
    camera.set_time_offset(i64::MAX);
    assert_eq!(next(&mut camera).unwrap().unwrap().timestamp_ns, 2000 + i64::MAX as u64);
}

#[test]
fn pictures_of_another_size_pass_with_their_pixels() {
    let plain = Plain { pairs: 2, next: 0, size: (8, 4), odd: false };
    let mut camera = FaultyCamera::new(plain, (WIDTH, HEIGHT), 1, 1);
    camera.set_dark(Sides::Both);
    camera.set_time_offset(7);
    let seen = next(&mut camera).unwrap().unwrap();
    assert_eq!((seen.left, seen.timestamp_ns), (picture(false, 0, (8, 4)), 7));
    let mut empty = FaultyCamera::new(Plain { pairs: 2, next: 0, size: (8, 4), odd: false }, (0, 0), 0, 1);
    empty.set_row_shift(1);
    assert!(next(&mut empty).unwrap().is_some());
}
