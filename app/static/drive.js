// The drive of a solution: whether it turns, where it is at the samples, and its unit.

/** Whether the coordinate of a solution's drive is an angle; a slider's or cylinder's is a length. */
export const driveTurns = (solution) => !["slider", "cylinder"].includes(solution.driver);

/** The places of a solution's drive at the samples, in degrees or lengths; null where the request gives them. */
export const drivePlaces = (solution) => solution.crank_angle ?? solution.travel ?? null;

/** The name of a solution's drive: crank, slider, cylinder or hinge. */
export const driveName = (solution) => solution.driver ?? "crank";
