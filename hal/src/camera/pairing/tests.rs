use super::*;

const PERIOD_NS: u64 = 33_333_333;
const TOLERANCE_NS: u64 = 5_000_000;

/// SplitMix64.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, end: u64) -> u64 {
        self.next() % end
    }

    fn percent(&mut self, percent: u64) -> bool {
        self.below(100) < percent
    }
}

/// The pairs of two lists, by looking at all of them: each left picture takes the first right one that fits and was not
/// passed over yet. Places in the lists.
fn plain(left: &[Stamp], right: &[Stamp]) -> Vec<(usize, usize)> {
    let mut pairs: Vec<(usize, usize)> = Vec::new();
    for (l, left) in left.iter().enumerate() {
        let free = pairs.last().map_or(0, |(_, r)| r + 1);
        let fits = |r: &usize| right[*r].timestamp_ns.abs_diff(left.timestamp_ns) <= TOLERANCE_NS;
        pairs.extend((free..right.len()).find(fits).map(|r| (l, r)));
    }
    pairs
}

/// Feeds both lists as a camera does: always the side that is wanted. The pairs, what was dropped, and the counts.
#[expect(clippy::type_complexity, reason = "a test's own")]
fn stream(left: &[Stamp], right: &[Stamp]) -> (Vec<Paired<usize>>, Vec<(Side, usize)>, Pairing<usize>) {
    let mut pairing = Pairing::new(TOLERANCE_NS);
    let (mut pairs, mut dropped) = (Vec::new(), Vec::new());
    let (mut lefts, mut rights) = (left.iter().enumerate(), right.iter().enumerate());
    loop {
        let side = pairing.wanted();
        let next = match side {
            Side::Left => lefts.next(),
            Side::Right => rights.next(),
        };
        let Some((place, stamp)) = next else { break };
        pairs.extend(pairing.push(side, *stamp, place, |side, place| dropped.push((side, place))));
    }
    (pairs, dropped, pairing)
}

/// A camera whose pictures are lost by chance, and whose times jitter.
fn camera(random: &mut Random, moments: u64, start: u32, loss_percent: u64, jitter_ns: u64) -> Vec<Stamp> {
    let mut stamps = Vec::new();
    for moment in 0..moments {
        if !random.percent(loss_percent) {
            let timestamp_ns = 1_000_000_000 + moment * PERIOD_NS + random.below(jitter_ns);
            stamps.push(Stamp { timestamp_ns, sequence: start.wrapping_add(moment as u32) });
        }
    }
    stamps
}

#[test]
fn pairs_are_those_of_a_search_through_everything() {
    for seed in 0..300 {
        let mut random = Random(seed);
        let loss = random.below(40);
        let jitter = [1, TOLERANCE_NS, 2 * TOLERANCE_NS, PERIOD_NS][random.below(4) as usize];
        // Numbers that go round at 2^32 on the way.
        let start = u32::MAX - random.below(100) as u32;
        let left = camera(&mut random, 200, start, loss, jitter);
        let right = camera(&mut random, 200, start.wrapping_add(77), loss, jitter);
        let (pairs, dropped, pairing) = stream(&left, &right);
        let found: Vec<_> = pairs.iter().map(|pair| (pair.left, pair.right)).collect();
        // Pictures at the end may lack a partner that was not asked for any more.
        let plain = plain(&left, &right);
        assert_eq!(found, plain, "seed {seed}");
        for pair in &pairs {
            let (left_ns, right_ns) = (left[pair.left].timestamp_ns, right[pair.right].timestamp_ns);
            assert_eq!(pair.timestamp_ns, left_ns);
            assert_eq!(i128::from(pair.skew_ns), i128::from(right_ns) - i128::from(left_ns));
        }
        // Every picture is in a pair, dropped, or waits: never two of these.
        let mut all: Vec<(Side, usize)> =
            pairs.iter().flat_map(|pair| [(Side::Left, pair.left), (Side::Right, pair.right)]).collect();
        all.extend(&dropped);
        let taken = all.len();
        all.sort_by_key(|(side, place)| (*side == Side::Right, *place));
        all.dedup();
        assert_eq!(all.len(), taken, "seed {seed}");
        let waiting = usize::from(pairing.holds(Side::Left)) + usize::from(pairing.holds(Side::Right));
        assert!(taken + waiting <= left.len() + right.len());
        assert_eq!(pairing.counts().unpaired, dropped.len() as u64);
        assert_eq!((pairing.counts().jumps, pairing.counts().restarts, pairing.counts().apart), (0, 0, 0));
    }
}

#[test]
fn numbers_of_pairs_have_a_gap_for_every_moment_that_is_lost() {
    for seed in 0..200 {
        let mut random = Random(1000 + seed);
        let left = camera(&mut random, 150, 0, 20, 1);
        let right = camera(&mut random, 150, 0, 20, 1);
        let (pairs, _, _) = stream(&left, &right);
        // With losses of pictures only, and the same start, the moment is the driver's number.
        let moment = |pair: &Paired<usize>| left[pair.left].sequence;
        for (before, after) in pairs.iter().zip(pairs.iter().skip(1)) {
            let between = moment(before) + 1..moment(after);
            assert_eq!(after.sequence - before.sequence - 1, between.len() as u32, "seed {seed}");
            // Of each moment in between at least one picture is gone, and the other has no partner: two pictures.
            assert_eq!(after.missed, 2 * between.len() as u32, "seed {seed}");
        }
    }
}

#[test]
fn a_picture_that_is_damaged_is_lost_and_its_partner_dropped() {
    let stamp = |moment: u32| Stamp { timestamp_ns: u64::from(moment) * PERIOD_NS, sequence: moment };
    let mut pairing = Pairing::new(TOLERANCE_NS);
    let mut dropped = Vec::new();
    let mut drop = |side, place| dropped.push((side, place));
    assert_eq!(pairing.push(Side::Left, stamp(0), 'a', &mut drop), None);
    assert!(pairing.push(Side::Right, stamp(0), 'b', &mut drop).is_some());
    assert_eq!(pairing.push(Side::Left, stamp(1), 'c', &mut drop), None);
    pairing.damaged(Side::Right, stamp(1));
    assert_eq!(pairing.push(Side::Right, stamp(2), 'd', &mut drop), None);
    let pair = pairing.push(Side::Left, stamp(2), 'e', &mut drop).unwrap();
    assert_eq!((pair.left, pair.right, pair.sequence, pair.missed), ('e', 'd', 2, 2));
    assert_eq!(dropped, [(Side::Left, 'c')]);
    assert_eq!((pairing.counts().lost, pairing.counts().unpaired, pairing.counts().pairs), (1, 1, 2));
}

#[test]
fn clocks_that_jump_or_wrap_are_survived_and_said() {
    for seed in 0..100 {
        let mut random = Random(2000 + seed);
        // Both cameras have the system's clock: it jumps for both at the same moment, with a picture in between at most.
        let at = 20 + random.below(20);
        let jump: i64 = match seed % 4 {
            0 => -(random.below(900_000_000) as i64),
            1 => random.below(1 << 50) as i64,
            2 => i64::MIN / 2,
            _ => -(random.below(1 << 55) as i64),
        };
        let times = |late: u64| -> Vec<Stamp> {
            (0..80)
                .map(|moment| {
                    let ns = (1 << 62) + moment * PERIOD_NS;
                    let ns = if moment >= at + late { ns.wrapping_add_signed(jump) } else { ns };
                    Stamp { timestamp_ns: ns, sequence: moment as u32 }
                })
                .collect()
        };
        let (left, right) = (times(0), times(random.below(2)));
        let (pairs, _, pairing) = stream(&left, &right);
        assert!(pairs.iter().all(|pair| pair.skew_ns.unsigned_abs() <= TOLERANCE_NS), "seed {seed}");
        // As long as time is repeated, the older pictures are dropped; afterwards everything is as before.
        let last = pairs.last().unwrap();
        assert_eq!((last.left, last.right), (79, 79), "seed {seed}: jump {jump} ns");
        if jump < -(PERIOD_NS as i64) || jump > 10_000_000_000 {
            assert!(pairing.counts().jumps >= 2, "seed {seed}: said");
        }
    }
}

#[test]
fn cameras_whose_clocks_differ_never_pair_and_block_nothing() {
    let left: Vec<Stamp> = (0..50).map(|m| Stamp { timestamp_ns: m * PERIOD_NS, sequence: m as u32 }).collect();
    let right: Vec<Stamp> = left.iter().map(|s| Stamp { timestamp_ns: s.timestamp_ns + (1 << 60), ..*s }).collect();
    let (pairs, dropped, pairing) = stream(&left, &right);
    assert!(pairs.is_empty());
    assert_eq!(dropped.len(), 100, "pictures of both sides are given back: neither stream stands still");
    assert_eq!(pairing.counts().apart, 50, "said");
}

#[test]
fn a_restart_begins_anew_but_the_numbers_go_on() {
    let stamp = |moment: u64| Stamp { timestamp_ns: moment * PERIOD_NS, sequence: moment as u32 };
    let mut pairing = Pairing::new(TOLERANCE_NS);
    let mut given_back = Vec::new();
    for moment in 500..503 {
        assert!(pairing.push(Side::Left, stamp(moment), moment, |_, _| ()).is_none());
        assert!(pairing.push(Side::Right, stamp(moment), moment, |_, _| ()).is_some());
    }
    assert!(pairing.push(Side::Left, stamp(503), 503, |_, _| ()).is_none());
    pairing.restart(|side, moment| given_back.push((side, moment)));
    assert_eq!(given_back, [(Side::Left, 503)]);
    assert_eq!(pairing.wanted(), Side::Left);
    assert!(pairing.push(Side::Left, stamp(3), 3, |_, _| ()).is_none());
    let pair = pairing.push(Side::Right, stamp(3), 3, |_, _| ()).unwrap();
    assert_eq!((pair.sequence, pair.missed), (4, 1), "the picture that was given back is counted");
    assert_eq!((pairing.counts().jumps, pairing.counts().restarts), (0, 0));
}

#[test]
fn a_second_picture_of_a_side_takes_the_place_of_the_first() {
    let mut pairing = Pairing::new(TOLERANCE_NS);
    let mut dropped = Vec::new();
    let stamp = |moment: u64| Stamp { timestamp_ns: moment * PERIOD_NS, sequence: moment as u32 };
    for moment in 0..4 {
        assert!(pairing.push(Side::Right, stamp(moment), moment, |_, moment| dropped.push(moment)).is_none());
    }
    assert_eq!(dropped, [0, 1, 2]);
    assert_eq!(pairing.push(Side::Left, stamp(3), 3, |_, _| ()).map(|pair| pair.missed), Some(3));
}

#[test]
fn what_is_passed_over_is_no_loss_but_leaves_a_gap() {
    let stamp = |moment: u64| Stamp { timestamp_ns: moment * PERIOD_NS, sequence: moment as u32 };
    let mut pairing = Pairing::new(TOLERANCE_NS);
    let mut dropped = Vec::new();
    pairing.push(Side::Left, stamp(0), 0, |_, _| ());
    assert!(pairing.push(Side::Right, stamp(0), 0, |_, _| ()).is_some());
    // Three moments wait on the left, two on the right: the newest of each does not fit, the next one does.
    pairing.pass_over(Side::Left, stamp(1));
    pairing.pass_over(Side::Left, stamp(2));
    assert!(pairing.push(Side::Left, stamp(3), 3, |_, moment| dropped.push(moment)).is_none());
    pairing.pass_over(Side::Right, stamp(1));
    assert!(pairing.push(Side::Right, stamp(2), 2, |_, moment| dropped.push(moment)).is_none());
    let pair = pairing.push(Side::Right, stamp(3), 3, |_, _| ()).unwrap();
    assert_eq!((pair.left, pair.right, pair.sequence, pair.missed), (3, 3, 3, 0));
    assert_eq!(dropped, [2]);
    assert_eq!((pairing.counts().passed_over, pairing.counts().unpaired, pairing.counts().lost), (4, 0, 0));
    // A picture that is really missing is told beside those that were passed over.
    pairing.pass_over(Side::Left, stamp(4));
    pairing.push(Side::Left, stamp(5), 5, |_, _| ());
    let pair = pairing.push(Side::Right, stamp(5), 5, |_, _| ()).unwrap();
    assert_eq!((pair.sequence, pair.missed), (5, 1));
}

#[test]
fn a_pair_that_is_spoilt_counts_as_lost_with_the_next_one() {
    let stamp = |moment: u64| Stamp { timestamp_ns: moment * PERIOD_NS, sequence: moment as u32 };
    let mut pairing = Pairing::new(TOLERANCE_NS);
    for moment in [0, 2, 3] {
        pairing.push(Side::Left, stamp(moment), moment, |_, _| ());
        let pair = pairing.push(Side::Right, stamp(moment), moment, |_, _| ()).unwrap();
        match moment {
            2 => pairing.spoilt(&pair),
            3 => assert_eq!((pair.sequence, pair.missed), (3, 4), "two pictures of moment 1, two of moment 2"),
            _ => {}
        }
    }
    assert_eq!((pairing.counts().pairs, pairing.counts().lost), (2, 4));
}

/// A driver with four buffers, one of which is lent to a caller who takes `busy` periods for each pair; the cameras lose
/// pictures by themselves where `lost` says.
fn slow_caller(busy: u64, lost: impl Fn(u64) -> bool) -> (PairingCounts, u32) {
    const ROOM: usize = 3;
    let mut pairing = Pairing::new(TOLERANCE_NS);
    let (mut now, mut missed, mut first) = (0_u64, 0, None);
    let mut waiting: Vec<u64> = Vec::new();
    for call in 0..50 {
        // While the caller is busy the driver fills what room it has.
        for moment in now..now + busy {
            if waiting.len() < ROOM && !lost(moment) {
                waiting.push(moment);
            }
        }
        now += busy;
        if call > 0 {
            pairing.away(busy * PERIOD_NS, ROOM as u32);
        }
        if waiting.is_empty() {
            now = (now..).find(|moment| !lost(*moment)).unwrap();
            waiting.push(now);
            now += 1;
        }
        let newest = waiting.pop().unwrap();
        let stamp = |moment: u64| Stamp { timestamp_ns: (moment + 1) * PERIOD_NS, sequence: moment as u32 };
        for side in [Side::Left, Side::Right] {
            waiting.iter().for_each(|moment| pairing.pass_over(side, stamp(*moment)));
        }
        waiting.clear();
        assert_eq!(pairing.push(Side::Left, stamp(newest), newest, |_, _| ()), None);
        let pair = pairing.push(Side::Right, stamp(newest), newest, |_, _| ()).unwrap();
        missed += pair.missed;
        // Every moment since the first picture has its number, whatever became of it.
        let first = *first.get_or_insert(newest - u64::from(pair.sequence));
        assert_eq!(first + u64::from(pair.sequence), newest);
    }
    (pairing.counts(), missed)
}

#[test]
fn what_a_driver_cannot_keep_for_a_caller_who_is_away_is_no_loss() {
    for busy in 4..40 {
        let (counts, missed) = slow_caller(busy, |_| false);
        assert_eq!((counts.lost, missed), (0, 0), "{busy} periods");
        assert!(counts.passed_over > 0);
    }
}

#[test]
fn what_is_lost_though_there_was_room_is_a_loss() {
    for busy in 0..3 {
        let (counts, missed) = slow_caller(busy, |moment| moment % 7 == 5);
        assert!(counts.lost > 0 && u64::from(missed) == counts.lost, "{busy} periods: {counts:?}");
        assert_eq!(slow_caller(busy, |_| false).0.lost, 0);
    }
}
