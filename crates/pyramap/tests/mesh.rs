//! The iso-surface of analytic and random maps, against what is known of them and a naive oracle.

use pyramap::Error;
use pyramap::block::{BLOCK_EDGE, BLOCK_VOXELS, Block, BlockData, BlockKey, Blocks, VoxelIndex, locate};
use pyramap::log_odds::{UNIT, to_fixed};
use pyramap::mesh::{Mesh, MeshOptions, extract};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::ops::Range;

/// A map in a hash table, each block stored whole.
struct Map {
    blocks: HashMap<BlockKey, Box<BlockData>>,
    /// Whether blocks of one value are given as `Uniform`.
    uniform: bool,
    voxel_size: f64,
    prior: f64,
}

impl Map {
    /// The blocks with all coordinates in a range, from the evidence at each voxel.
    fn new(blocks: Range<i32>, voxel_size: f64, evidence: impl Fn(VoxelIndex) -> i32) -> Self {
        let edge = BLOCK_EDGE as i32;
        let mut map = Self { blocks: HashMap::new(), uniform: true, voxel_size, prior: 0.0 };
        for voxel in voxels(blocks.start * edge..blocks.end * edge) {
            let (key, offset) = locate(voxel);
            map.blocks.entry(key).or_insert_with(|| Box::new([0; BLOCK_VOXELS]))[offset] = evidence(voxel);
        }
        map
    }

    /// The same, from a field of log-odds at the voxels' centres in metres.
    fn of_field(blocks: Range<i32>, voxel_size: f64, field: impl Fn([f64; 3]) -> f64) -> Self {
        Self::new(blocks, voxel_size, |voxel| to_fixed(field(voxel.map(|i| (f64::from(i) + 0.5) * voxel_size))))
    }

    fn evidence(&self, voxel: VoxelIndex) -> i32 {
        let (key, offset) = locate(voxel);
        self.blocks.get(&key).map_or(0, |block| block[offset])
    }
}

impl Blocks for Map {
    fn keys(&self) -> Vec<BlockKey> {
        self.blocks.keys().copied().collect()
    }
    fn block(&self, key: BlockKey) -> Option<Block<'_>> {
        let block = self.blocks.get(&key)?;
        let uniform = self.uniform && block.iter().all(|&value| value == block[0]);
        Some(if uniform { Block::Uniform(block[0]) } else { Block::Dense(block) })
    }
    fn voxel_size(&self) -> f64 {
        self.voxel_size
    }
    fn prior_log_odds(&self) -> f64 {
        self.prior
    }
}

/// All voxels whose coordinates lie in a range.
fn voxels(range: Range<i32>) -> impl Iterator<Item = VoxelIndex> {
    let (second, third) = (range.clone(), range.clone());
    range.flat_map(move |x| {
        let third = third.clone();
        second.clone().flat_map(move |y| third.clone().map(move |z| [x, y, z]))
    })
}

/// A hash of a voxel and a seed (the finaliser of SplitMix64): random numbers that need no order.
fn random(seed: u64, voxel: VoxelIndex) -> u64 {
    let mix = |x: u64| {
        let x = (x ^ x >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let x = (x ^ x >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        x ^ x >> 31
    };
    voxel.iter().fold(mix(seed), |state, &i| mix(state.wrapping_add(0x9E37_79B9_7F4A_7C15) ^ u64::from(i as u32)))
}

/// Random evidence in `-3..=3` steps; a voxel is `0` with the given chance in percent.
fn noise(seed: u64, unknown_percent: u64) -> impl Fn(VoxelIndex) -> i32 {
    move |voxel| {
        let number = random(seed, voxel);
        if number % 100 < unknown_percent { 0 } else { [-3, -2, -1, 1, 2, 3][(number >> 32) as usize % 6] }
    }
}

fn meshed(map: &Map) -> Mesh {
    mesh_at(map, 0.0)
}

fn mesh_at(map: &Map, level: f64) -> Mesh {
    extract(map, &MeshOptions { level, ..Default::default() }).unwrap()
}

type Point = [f64; 3];

fn subtract(a: Point, b: Point) -> Point {
    [0, 1, 2].map(|i| a[i] - b[i])
}

fn dot(a: Point, b: Point) -> f64 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

fn cross(a: Point, b: Point) -> Point {
    [0, 1, 2].map(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        a[j] * b[k] - a[k] * b[j]
    })
}

fn norm(a: Point) -> f64 {
    dot(a, a).sqrt()
}

fn corners(mesh: &Mesh, face: &[u32; 3]) -> [Point; 3] {
    face.map(|vertex| mesh.vertices[vertex as usize].map(f64::from))
}

/// Normal of a face, as long as twice its area.
fn face_normal(mesh: &Mesh, face: &[u32; 3]) -> Point {
    let [a, b, c] = corners(mesh, face);
    cross(subtract(b, a), subtract(c, a))
}

fn area(mesh: &Mesh) -> f64 {
    mesh.faces.iter().map(|face| norm(face_normal(mesh, face)) / 2.0).sum()
}

/// The volume enclosed, positive if the faces look outward.
fn volume(mesh: &Mesh) -> f64 {
    let signed = |face| {
        let [a, b, c] = corners(mesh, face);
        dot(a, cross(b, c)) / 6.0
    };
    mesh.faces.iter().map(signed).sum()
}

/// How many faces run along each directed edge.
fn directed_edges(mesh: &Mesh) -> BTreeMap<(u32, u32), usize> {
    let mut edges = BTreeMap::new();
    for &[a, b, c] in &mesh.faces {
        for edge in [(a, b), (b, c), (c, a)] {
            *edges.entry(edge).or_insert(0) += 1;
        }
    }
    edges
}

fn euler_characteristic(mesh: &Mesh) -> i64 {
    mesh.vertices.len() as i64 - directed_edges(mesh).len() as i64 / 2 + mesh.faces.len() as i64
}

/// What holds for every mesh: vertices are all used, faces have an area, normals are of unit length.
fn assert_sound(mesh: &Mesh) {
    let used: BTreeSet<_> = mesh.faces.iter().flatten().copied().collect();
    assert!(used.into_iter().eq(0..mesh.vertices.len() as u32), "each vertex is used, and no other");
    assert_eq!(mesh.normals.len(), mesh.vertices.len());
    for normal in &mesh.normals {
        assert!((norm(normal.map(f64::from)) - 1.0).abs() < 1e-6, "{normal:?}");
    }
    for face in &mesh.faces {
        assert!(norm(face_normal(mesh, face)) > 0.0, "{:?}", corners(mesh, face));
    }
    assert!(directed_edges(mesh).values().all(|&faces| faces == 1), "no two faces run along an edge the same way");
}

/// Each edge has two faces, in opposite directions, and the faces at each vertex form one closed fan.
fn assert_closed_manifold(mesh: &Mesh) {
    assert_sound(mesh);
    let edges = directed_edges(mesh);
    assert!(edges.keys().all(|&(a, b)| edges.contains_key(&(b, a))), "each edge has a face on either side");
    let mut around = vec![BTreeMap::new(); mesh.vertices.len()];
    for &[a, b, c] in &mesh.faces {
        for (vertex, from, to) in [(a, b, c), (b, c, a), (c, a, b)] {
            around[vertex as usize].insert(from, to);
        }
    }
    for fan in around {
        let (&start, mut at) = fan.first_key_value().unwrap();
        let mut faces = 1;
        while *at != start {
            at = &fan[at];
            faces += 1;
        }
        assert_eq!(faces, fan.len(), "one fan");
    }
}

/// The edge of the grid, as its first voxel and axis, on which a vertex lies: the one coordinate that is not a
/// voxel's centre. Vertices keep 1/256 voxel from the centres, and `f32` is far finer than that near the origin.
fn grid_edge(map: &Map, vertex: [f32; 3]) -> (VoxelIndex, usize) {
    let place = vertex.map(|x| f64::from(x) / map.voxel_size - 0.5);
    let off_centre: Vec<_> = (0..3).filter(|&i| (place[i] - place[i].round()).abs() > 1e-3).collect();
    let [axis] = off_centre[..] else { panic!("{place:?} is not on one edge") };
    (std::array::from_fn(|i| if i == axis { place[i].floor() } else { place[i].round() } as i32), axis)
}

fn step(mut voxel: VoxelIndex, axis: usize, by: i32) -> VoxelIndex {
    voxel[axis] += by;
    voxel
}

/// The edges that must have a vertex, with its place on the edge, found cell by cell.
fn oracle(map: &Map, around: Range<i32>, options: &MeshOptions) -> BTreeMap<(VoxelIndex, usize), f64> {
    let mut edges = BTreeMap::new();
    for cell in voxels(around) {
        if !is_valid(map, cell, options) {
            continue;
        }
        for [x, y, z] in voxels(0..2) {
            let start = [cell[0] + x, cell[1] + y, cell[2] + z];
            for axis in 0..3 {
                let end = step(start, axis, 1);
                if end[axis] > cell[axis] + 1 {
                    continue;
                }
                let value = |voxel| f64::from(map.evidence(voxel)) * UNIT + map.prior;
                let (a, b) = (value(start), value(end));
                if (a > options.level) != (b > options.level) {
                    edges.insert((start, axis), (options.level - a) / (b - a));
                }
            }
        }
    }
    edges
}

/// Whether all corners of the cell that starts with a voxel are known.
fn is_valid(map: &Map, cell: VoxelIndex, options: &MeshOptions) -> bool {
    voxels(0..2).all(|[x, y, z]| {
        let evidence = map.evidence([cell[0] + x, cell[1] + y, cell[2] + z]);
        evidence != 0 && f64::from(evidence).abs() * UNIT >= options.min_evidence
    })
}

/// The cells that hold all of the given edges: those whose 12 edges include each.
fn cells_with(edges: &[(VoxelIndex, usize)]) -> Vec<VoxelIndex> {
    let holds = |cell: VoxelIndex, &(voxel, axis): &(VoxelIndex, usize)| {
        (0..3).all(|i| (0..2 - i32::from(i == axis)).contains(&(voxel[i] - cell[i])))
    };
    let first = edges[0].0;
    voxels(-1..1)
        .map(|offset| [0, 1, 2].map(|i| first[i] + offset[i]))
        .filter(|&cell| edges.iter().all(|edge| holds(cell, edge)))
        .collect()
}

/// The vertices of the mesh are those of the oracle, each once; each face lies in a valid cell; and the mesh ends only
/// at a cell that is not valid.
fn assert_follows_oracle(map: &Map, around: Range<i32>, options: &MeshOptions) -> usize {
    let mesh = extract(map, options).unwrap();
    assert_sound(&mesh);
    let expected = oracle(map, around, options);
    let edges: Vec<_> = mesh.vertices.iter().map(|&vertex| grid_edge(map, vertex)).collect();
    assert_eq!(edges.len(), edges.iter().collect::<BTreeSet<_>>().len(), "one vertex an edge");
    assert_eq!(edges.iter().copied().collect::<BTreeSet<_>>(), expected.keys().copied().collect());
    for (&(voxel, axis), vertex) in edges.iter().zip(&mesh.vertices) {
        let fraction = f64::from(vertex[axis]) / map.voxel_size - 0.5 - f64::from(voxel[axis]);
        // 1/256 is how far a vertex is moved off a voxel's centre, 1e-5 is for f32.
        assert!((fraction - expected[&(voxel, axis)]).abs() < 1.0 / 256.0 + 1e-5);
    }
    for (&(voxel, axis), normal) in edges.iter().zip(&mesh.normals) {
        let falls = map.evidence(step(voxel, axis, 1)) < map.evidence(voxel);
        assert_eq!(normal[axis] > 0.0, falls, "normals point to the free end of the edge");
    }
    for face in &mesh.faces {
        let cells = cells_with(&face.map(|vertex| edges[vertex as usize]));
        assert!(matches!(cells[..], [cell] if is_valid(map, cell, options)), "a face lies in one cell: {cells:?}");
    }
    let directed = directed_edges(&mesh);
    for &(a, b) in directed.keys().filter(|&&(a, b)| !directed.contains_key(&(b, a))) {
        let cells = cells_with(&[edges[a as usize], edges[b as usize]]);
        assert_eq!(cells.len(), 2, "the mesh ends in a face between two cells");
        assert_eq!(cells.iter().filter(|&&cell| is_valid(map, cell, options)).count(), 1);
    }
    mesh.vertices.len()
}

/// Log-odds that fall by 100 a metre through a sphere's surface: 2 per voxel at 0.02 m.
fn sphere(centre: Point, radius: f64) -> impl Fn(Point) -> f64 {
    move |p| 100.0 * (radius - norm(subtract(p, centre)))
}

#[test]
fn a_sphere_is_round_closed_and_looks_outward() {
    let (voxel, radius) = (0.02, 0.25);
    // About the origin, where eight blocks meet; and off every symmetry, at negative coordinates, over block borders.
    for (centre, blocks) in [([0.0; 3], -2..2), ([-0.313, -0.297, -0.331], -4..0)] {
        let mesh = meshed(&Map::of_field(blocks, voxel, sphere(centre, radius)));
        assert_closed_manifold(&mesh);
        assert_eq!(euler_characteristic(&mesh), 2);
        // Along an edge of length h the distance to the centre differs from linear by at most h^2 / 8R', R' the
        // distance itself; nowhere on these edges is R' below R - h. Fixed point and f32 add less than 1 um.
        let sag = voxel * voxel / (8.0 * (radius - voxel));
        let mut rough = 0;
        for (vertex, normal) in mesh.vertices.iter().zip(&mesh.normals) {
            let outward = subtract(vertex.map(f64::from), centre);
            assert!((norm(outward) - radius).abs() < sag + 1e-6, "{}", norm(outward) - radius);
            // Central differences of a distance err by h^2 / R^2 = 0.4 degrees at the most; where they have the wrong
            // sign along an edge that all but touches the sphere, the edge's own difference errs by h / 2R, 2.3 degrees.
            let cosine = dot(normal.map(f64::from), outward) / norm(outward);
            assert!(cosine > 0.999, "{cosine}");
            rough += usize::from(cosine < 0.9999);
        }
        assert!(rough * 100 < mesh.vertices.len(), "{rough}");
        // Vertices within `sag` of the sphere, and the middle of a triangle, with sides up to sqrt(3) h, lies at most
        // the square of its circumradius h over 2R below: relative to R 2 (sag / R + h^2 / 2R^2) = 1.1 % for the area,
        // half as much again for the volume. The mesh lies inside on the whole.
        let depth = sag / radius + voxel * voxel / (2.0 * radius * radius);
        let (true_area, true_volume) =
            (4.0 * std::f64::consts::PI * radius.powi(2), 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3));
        assert!((area(&mesh) / true_area - 1.0).abs() < 2.0 * depth, "{}", area(&mesh) / true_area);
        assert!((volume(&mesh) / true_volume - 1.0).abs() < 3.0 * depth, "{}", volume(&mesh) / true_volume);
        for face in &mesh.faces {
            let normal = face_normal(&mesh, face);
            assert!(face.iter().all(|&vertex| dot(normal, mesh.normals[vertex as usize].map(f64::from)) > 0.0));
        }
    }
}

#[test]
fn a_free_bubble_looks_inward() {
    let bubble = sphere([0.0; 3], 0.2);
    let mesh = meshed(&Map::of_field(-2..2, 0.02, |p| -bubble(p)));
    assert_closed_manifold(&mesh);
    assert!(volume(&mesh) < 0.0);
}

#[test]
fn a_torus_has_one_handle() {
    let torus = |p: Point| 0.08 - ((p[0].hypot(p[1]) - 0.2).powi(2) + p[2] * p[2]).sqrt();
    let mesh = meshed(&Map::of_field(-3..3, 0.02, |p| 100.0 * torus(p)));
    assert_closed_manifold(&mesh);
    assert_eq!(euler_characteristic(&mesh), 0);
    assert!(mesh.vertices.iter().any(|v| v[0] < 0.0) && volume(&mesh) > 0.0);
}

#[test]
fn a_plane_is_exact_wherever_it_lies() {
    let voxel = 0.125;
    // In voxels: between blocks, on a voxel's centre (which meets the level exactly) beside a block border, elsewhere.
    for place in [0.0, 8.0, -8.0, 7.5, 8.5, -0.5, 0.5, 3.25, -5.125] {
        for axis in 0..3 {
            // One log-odd a voxel, so that every number is exact; 40 more, so that none is zero.
            let map = Map::of_field(-2..2, voxel, |p| 40.0 + place - p[axis] / voxel);
            let mesh = mesh_at(&map, 40.0);
            assert_sound(&mesh);
            // 32 x 32 voxels; 31 x 31 cells of two triangles.
            assert_eq!((mesh.vertices.len(), mesh.faces.len()), (32 * 32, 31 * 31 * 2));
            // A voxel at the level is outside, and the vertex stays 1/256 voxel on the inner side of its centre.
            let meets_level = (place - 0.5_f64).fract() == 0.0;
            let expected = place - if meets_level { 1.0 / 256.0 } else { 0.0 };
            for (vertex, normal) in mesh.vertices.iter().zip(&mesh.normals) {
                assert_eq!(f64::from(vertex[axis]) / voxel, expected);
                assert_eq!(normal[axis], 1.0);
            }
        }
    }
}

#[test]
fn random_fields_give_closed_manifolds() {
    // All 256 cases, next to one another in every way, and values that meet the level; free at the border of the map.
    for (seed, level) in [(1, 0.0), (2, UNIT), (3, -2.0 * UNIT), (4, 0.3 * UNIT)] {
        let random = noise(seed, 0);
        let inner = -15..15;
        let map =
            Map::new(-2..2, 0.1, |voxel| if voxel.iter().all(|i| inner.contains(i)) { random(voxel) } else { -3 });
        let mesh = mesh_at(&map, level);
        assert!(mesh.faces.len() > 10_000);
        assert_closed_manifold(&mesh);
        assert!(volume(&mesh) > 0.0);
    }
}

#[test]
fn vertices_and_faces_are_those_of_the_oracle() {
    for (seed, unknown_percent) in [(1, 0), (2, 2), (3, 10), (4, 30)] {
        for (level, min_evidence) in [(0.0, 0.0), (UNIT, 0.0), (0.5 * UNIT, 1.5 * UNIT), (0.0, 2.0 * UNIT)] {
            let mut map = Map::new(-1..1, 0.05, noise(seed, unknown_percent));
            // Missing blocks, and neighbours of one value.
            map.blocks.remove(&[0, -1, 0]);
            map.blocks.get_mut(&[-1, 0, 0]).unwrap().fill(2);
            map.blocks.get_mut(&[-1, 0, -1]).unwrap().fill(-1);
            let options = MeshOptions { level, min_evidence, ..Default::default() };
            let vertices = assert_follows_oracle(&map, -10..10, &options);
            // A third of the voxels is weak where `min_evidence` counts: few cells are left, with 30 % unknown none.
            assert!(vertices > 0 || (min_evidence > 0.0 && unknown_percent == 30), "there is something to test");
        }
    }
}

#[test]
fn uniform_blocks_meet_their_neighbours() {
    // An occupied block of one value among free ones: a cube of 8 voxels, its edges and corners cut off.
    let map = Map::new(-2..2, 0.1, |voxel| if locate(voxel).0 == [-1, -1, -1] { 100 } else { -100 });
    let mesh = meshed(&map);
    assert_closed_manifold(&mesh);
    assert_eq!(euler_characteristic(&mesh), 2);
    // The surface lies half-way between centres: on the cube's faces, each of 8 x 8 vertices.
    assert_eq!(mesh.vertices.len(), 6 * 64);
    // Off the cube, in units of half voxels: 12 edges lose 7 prisms of 1/2 x 1/2 x 1/2 each, and 8 corners all but
    // the tetrahedron of the case with one corner inside: a cube less 1/48.
    let lost = 12.0 * 7.0 / 8.0 + 8.0 * (1.0 / 8.0 - 1.0 / 48.0);
    assert!((volume(&mesh) - (512.0 - lost) * 1e-3).abs() < 1e-5, "{}", volume(&mesh) * 1e3 - 512.0);
}

#[test]
fn how_blocks_are_stored_does_not_matter() {
    let mut map = Map::of_field(-2..2, 0.02, |p| sphere([0.05, -0.1, 0.0], 0.1)(p).clamp(-2.0, 2.0));
    let with_uniform = meshed(&map);
    assert!(map.keys().into_iter().any(|key| matches!(map.block(key), Some(Block::Uniform(_)))));
    map.uniform = false;
    assert_eq!(meshed(&map), with_uniform);
}

#[test]
fn no_face_touches_an_unknown_voxel() {
    // A sphere of which one half is unknown: the mesh ends at the last known layer of cells.
    let sphere = sphere([0.0; 3], 0.2);
    let map = Map::of_field(-2..2, 0.02, |p| if p[2] > 0.0 { 0.0 } else { sphere(p) });
    let mesh = meshed(&map);
    assert_sound(&mesh);
    let top = mesh.vertices.iter().map(|vertex| vertex[2]).fold(f32::MIN, f32::max);
    assert!(top <= -0.01 && top > -0.03, "{top}");
}

#[test]
fn normals_beside_unknown_voxels_are_those_of_the_field() {
    // A linear field has the same slope from either side or both; unknown voxels are scattered, and half the map.
    let slope = [2.0 / 7.0, -3.0 / 7.0, 6.0 / 7.0];
    let map = Map::new(-1..1, 1.0, |voxel| {
        let unknown = voxel[0] > 2 || random(7, voxel).is_multiple_of(20);
        if unknown { 0 } else { to_fixed(30.0 - dot(slope, voxel.map(f64::from))) }
    });
    let mesh = mesh_at(&map, 30.1);
    assert!(mesh.vertices.len() > 50);
    for normal in &mesh.normals {
        // A slope is rounded to fixed point twice, by half a unit.
        assert!((0..3).all(|i| (f64::from(normal[i]) - slope[i]).abs() < 2.0 * UNIT), "{normal:?}");
    }
}

#[test]
fn min_evidence_makes_weak_voxels_unknown() {
    // One log-odd a voxel around a plane: the voxels beside it have 0.5, the next 1.5.
    let map = Map::of_field(-1..1, 1.0, |p| -p[0]);
    let faces = |min_evidence| extract(&map, &MeshOptions { min_evidence, ..Default::default() }).unwrap().faces.len();
    assert_eq!(faces(0.0), 15 * 15 * 2);
    assert_eq!(faces(0.5), 15 * 15 * 2, "as much as the least is enough");
    assert_eq!(faces(0.5 + UNIT / 2.0), 0);
    assert_eq!(faces(1e5), 0);
}

#[test]
fn the_level_includes_the_prior() {
    let field = |p: Point| 40.0 + p[1];
    let mut map = Map::of_field(-1..1, 1.0, field);
    let height = |map: &Map, level| {
        let mesh = mesh_at(map, level);
        assert!(mesh.vertices.iter().all(|vertex| vertex[1] == mesh.vertices[0][1]));
        mesh.vertices[0][1]
    };
    assert_eq!(height(&map, 42.0), 2.0);
    map.prior = -1.25;
    assert_eq!(height(&map, 42.0), 3.25);
    assert_eq!(mesh_at(&map, 1e5), Mesh::default());
    assert_eq!(mesh_at(&map, -1e5), Mesh::default());
}

#[test]
fn a_wall_one_voxel_thick_has_its_normals_outside() {
    // A central difference at the wall compares the free voxels on either side and sees nothing of it.
    let map = Map::new(-1..1, 0.1, |voxel| if voxel[2] == -1 { 1000 } else { -1000 });
    let mesh = meshed(&map);
    assert_sound(&mesh);
    assert_eq!(mesh.faces.len(), 2 * 15 * 15 * 2);
    for (vertex, normal) in mesh.vertices.iter().zip(&mesh.normals) {
        assert_eq!(*normal, [0.0, 0.0, if vertex[2] < -0.05 { -1.0 } else { 1.0 }]);
    }
}

#[test]
fn the_extremes_of_evidence_are_numbers_too() {
    let extreme = |voxel| if random(5, voxel) & 1 == 0 { i32::MIN } else { i32::MAX };
    let map = Map::new(-1..1, 0.1, extreme);
    for level in [0.0, i32::MAX as f64 * UNIT, i32::MIN as f64 * UNIT] {
        assert_follows_oracle(&map, -10..10, &MeshOptions { level, ..Default::default() });
    }
    assert_eq!(mesh_at(&map, i32::MAX as f64 * UNIT), Mesh::default(), "nothing lies above");
    assert!(!mesh_at(&map, i32::MIN as f64 * UNIT).faces.is_empty(), "what meets the level lies outside");
}

#[test]
fn the_mesh_does_not_depend_on_threads_or_the_order_of_keys() {
    let field = |p| sphere([-0.05, 0.02, 0.3], 0.35)(p) + 30.0 * (40.0 * p[0]).sin();
    // Each map hashes its keys in an order of its own.
    let mesh_with = |threads| {
        let map = Map::of_field(-3..4, 0.02, field);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| meshed(&map))
    };
    let mesh = mesh_with(1);
    assert_sound(&mesh);
    assert!(mesh.faces.len() > 10_000);
    for threads in [1, 2, 3] {
        assert_eq!(mesh_with(threads), mesh);
    }
}

#[test]
fn an_empty_map_has_an_empty_mesh() {
    assert_eq!(meshed(&Map::new(0..0, 0.1, |_| 0)), Mesh::default());
    assert_eq!(meshed(&Map::new(0..1, 0.1, |_| 0)), Mesh::default());
    assert_eq!(meshed(&Map::new(0..1, 0.1, |_| 5)), Mesh::default());
}

#[test]
fn options_out_of_range_are_refused() {
    let map = Map::new(0..1, 0.1, |_| 1);
    for (level, min_evidence, name) in [
        (f64::NAN, 0.0, "level"),
        (f64::INFINITY, 0.0, "level"),
        (-524_289.0, 0.0, "level"),
        (0.0, f64::NAN, "min_evidence"),
        (0.0, f64::INFINITY, "min_evidence"),
        (0.0, 524_289.0, "min_evidence"),
        (0.0, -0.1, "min_evidence"),
    ] {
        let error = extract(&map, &MeshOptions { level, min_evidence, ..Default::default() }).unwrap_err();
        assert!(matches!(error, Error::Parameter { name: refused, .. } if refused == name), "{error}");
    }
}
