// entries: what Python writes into a scene, written by
// tools/web/write_conventions.py from the TypedDicts there; change it there.
export type SectionKind = "f32" | "f16" | "u16" | "u8" | "p8" | "p16" | "p24";
export type Section = [SectionKind, number, number];
export type ControlEntry = number | number[];
export type ModelEntry = AnchorsEntry | LayersEntry;
export type RegionEntry = PaintedEntry | HalfSpaceEntry | BoxEntry | SphereEntry;
/** The table of contents; metres, m/s^2, display sRGB. null: nobody knows. */
export interface SceneEntry {
    format: "shapeshift web 1";
    title: string;
    profile: "any" | "quest";
    background: number[];
    brightest: number | null;
    radius: number;
    view: ViewEntry;
    gravity: number;
    floorY: number | null;
    models: ModelEntry[];
    objects: ObjectEntry[];
    palettes: Record<string, TableEntry>;
}
/** A model of anchors; metres. light: harmonics of degree 1 and 2, 8 numbers a channel. */
export interface AnchorsEntry {
    swell: number;
    stops: StopEntry[];
    pace: PaceEntry[];
    direct: boolean;
    kind: "anchors";
    anchors: number;
    perAnchor: number;
    featureVecs: number;
    encoding: EncodingEntry;
    positions: TableEntry;
    features: TableEntry;
    networks: Record<string, NetworkEntry>;
    scales?: TableEntry;
    wxyz?: TableEntry;
    light?: TableEntry;
}
/** Plain splats, each of the stop whose number is its layer; sh, shRest: harmonics. */
export interface LayersEntry {
    swell: number;
    stops: StopEntry[];
    pace: PaceEntry[];
    direct: boolean;
    scales: TableEntry;
    wxyz: TableEntry;
    kind: "layers";
    anchors: number;
    perAnchor: number;
    mode: string;
    antialiased: boolean;
    coefficients: number;
    positions: TableEntry;
    opacity: TableEntry;
    layer: Section;
    sh: TableEntry;
    shRest?: TableEntry;
}
/** How much of each anchor is in it, 0 to 1. */
export interface PaintedEntry {
    x: ControlEntry;
    space: string;
    kind: "painted";
    weight: TableEntry;
}
/** All behind a plane through a point; the normal has any length. */
export interface HalfSpaceEntry {
    x: ControlEntry;
    space: string;
    border: number;
    kind: "half";
    point: [number, number, number];
    normal: [number, number, number];
}
/** Half its sides, and how it is turned. */
export interface BoxEntry {
    x: ControlEntry;
    space: string;
    border: number;
    kind: "box";
    centre: [number, number, number];
    half: [number, number, number];
    wxyz: [number, number, number, number];
}
/** A ball; metres. */
export interface SphereEntry {
    x: ControlEntry;
    space: string;
    border: number;
    kind: "sphere";
    centre: [number, number, number];
    radius: number;
}
/** The first look: world metres; fovY in radians. */
export interface ViewEntry {
    eye: number[];
    target: number[];
    fovY: number;
}
/** model: its number; pose in the world; bounding box and sphere in the object; metres. */
export interface ObjectEntry {
    name: string;
    model: number;
    position: number[];
    wxyz: number[];
    x: ControlEntry;
    visible: boolean;
    centre: number[];
    half: number[];
    radius: number;
    movable: boolean;
    solid: boolean;
    restitution: number;
    states: StateEntry[];
    regions: RegionEntry[];
}
/** (N, width) numbers as codes 0..most between the ends (2, width) of each column. Without `most` the codes are the numbers themselves. */
export interface TableEntry {
    codes: Section;
    ends: Section;
    width: number;
    most?: number;
}
/** A stop of the slider; without a palette it shows colours, not values. */
export interface StopEntry {
    name: string;
    x: number;
    kind: string;
    palette: string;
    valueRange: [number, number] | null;
    unit: string;
    digits: number;
}
/** Weight of stop `end` at even steps of the way from stop `start`, both by their numbers. */
export interface PaceEntry {
    start: number;
    end: number;
    blend: number[];
}
/** Psi of a control (paper eq. 6 and 7): d Gaussians. */
export interface EncodingEntry {
    d: number;
    spacing: number;
    sigma: number;
}
/** A head: gain * head(clip(last layer)); control: what Psi enters the first layer with. */
export interface NetworkEntry {
    layers: LayerEntry[];
    control: Section | null;
    looks: boolean;
    head: string;
    clip: [number, number];
    gain: number;
}
/** A button of the slider; picture: a data address. */
export interface StateEntry {
    name: string;
    x: number;
    picture?: string;
}
/** A layer of a network: weights (outs, 4 ins, 4), bias (4 outs); counts of vectors of four. */
export interface LayerEntry {
    ins: number;
    outs: number;
    weights: Section;
    bias: Section;
}
