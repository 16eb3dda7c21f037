// The drives of a function: what each asks for and is called.

const TRAVEL = "length";
/** What a drive asks for, and what goes in and comes out. */
export const DRIVES = {
  four_bar: { asks: {}, says: ["Crank turns", "Rocker turns"] },
  crank_slider: { asks: { output_unit: TRAVEL, mechanisms: ["slider_crank"] }, says: ["Crank turns", "Slider moves"] },
  crank_cylinder: {
    asks: { output_unit: TRAVEL, mechanisms: ["swinging_block"] },
    says: ["Crank turns", "Cylinder extends"],
  },
  slider_crank: { asks: { input_unit: TRAVEL, mechanisms: ["slider_crank"] }, says: ["Slider moves", "Crank turns"] },
  cylinder_crank: {
    asks: { input_unit: TRAVEL, mechanisms: ["swinging_block"] },
    says: ["Cylinder extends", "Crank turns"],
  },
  slider_lever: { asks: { input_unit: TRAVEL, mechanisms: ["rail_slot"] }, says: ["Slider moves", "Lever turns"] },
  slider_slider: {
    asks: { input_unit: TRAVEL, output_unit: TRAVEL, mechanisms: ["two_rails"] },
    says: ["Slider moves", "Other slider moves"],
  },
  slider_cylinder: {
    asks: { input_unit: TRAVEL, output_unit: TRAVEL, mechanisms: ["rail_slot"] },
    says: ["Slider, or cylinder, moves", "The other moves"],
  },
};
/** Functions that are asked for by a few numbers. */
export const SPECIAL = ["quick", "steering"];
/** Drives with a quick return, and the field of its size. */
export const SIZES = {
  four_bar: { field: "swing", says: ["Rocker swings", "°"] },
  crank_slider: { field: "stroke", says: ["Slider's stroke", "length"] },
};
/** True; throws if a drive does not make such a function. */
export function checkDrive(name, drive) {
  if (name === "quick" && !(drive in SIZES))
    throw new Error("A quick return is made by a four-bar or by a crank that moves a slider: choose one of these.");
  if (name === "steering" && drive !== "four_bar") throw new Error("Steering is made by a four-bar: choose it.");
  return true;
}
/** What stands behind a number of a unit. */
export const sign = (unit) => (unit === TRAVEL ? "" : "°");
