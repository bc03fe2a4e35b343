// Every text of the page, in one place.
const plural = (n: number, one: string, many = one + 's') => `${n} ${n === 1 ? one : many}`;

export const t = {
  title: 'VSS station',
  pictures: 'Pictures',
  views: { picture: 'Picture', scene: '3D', both: 'Both' },
  undo: 'Undo', redo: 'Redo', undoWhat: (label: string) => `Undo: ${label}`, redoWhat: (label: string) => `Redo: ${label}`,
  noPicture: 'The picture cannot be read.', noAnswer: 'The station does not answer. Is it still running?', answered: (status: number) => `The station answered ${status}.`, cannotShow: 'The station cannot show this survey', tryAgain: 'Try again',
  undoRedo: 'Undo and redo', viewLabel: 'View', panels: 'Panels', progress: 'Progress of the survey', zoomLabel: 'Zoom', pictureLabel: (file: string, hint: string) => `Picture ${file}: ${hint}`, back: 'Back', forward: 'Next',
  badPicture: (file: string) => `${file} cannot be shown: it may be damaged. Copy it again.`, closeMessage: 'Close this message',
  run: 'Run survey', runAgain: 'Run again', cancel: 'Cancel', running: (step: string, done: number, total: number) => `${stepNames[step] ?? step} ${done} of ${total}`,
  runs: {
    survey: { done: (m: string) => `Survey finished: ${m}.`, failed: (m: string) => `The survey stopped: ${m}`, cancelled: 'The survey was cancelled. Nothing changed.' },
    calibration: { done: (m: string) => `Calibration finished: ${m}.`, failed: (m: string) => `The calibration stopped: ${m}`, cancelled: 'The calibration was cancelled. Nothing changed.' },
  },
  export: 'Export',
  exports: {
    product: 'Product data (product.json)', report: 'Report with pictures (report.html)', overlay: 'Overlay of this picture (SVG)',
    step: 'CAD model with seams (STEP)', noStep: 'CAD model (STEP): not part of this build', glb: '3D model with seams (glTF)', parts: 'Table of parts (CSV)', seams: 'Table of seams (CSV)',
  },
  shortcuts: 'Keyboard shortcuts', guide: 'First survey, step by step',
  offline: 'The station does not answer. Your confirmed edits are saved; the page goes on by itself when it is back.',
  conflict: (m: string) => `Not saved: ${m}.`,
  othersEdit: (who: string) => `${who} changed the survey on another page.`,
  tabs: { parts: 'Parts', todo: 'To do', build: 'By hand', parameters: 'Parameters', cameras: 'Cameras', history: 'History', help: 'Help' },
  strip: { lines: (n: number) => plural(n, 'line'), parts: (n: number) => plural(n, 'part'), doubtful: (n: number) => `${n} doubtful`, none: 'no part yet', loading: '…', broken: 'cannot be read' },
  layers: {
    title: 'Layers', picture: 'Grey picture', lines: 'Lines', parts: 'Parts', hidden: 'Hidden edges', residuals: 'Residuals', vertices: 'Vertices',
    colourBy: 'Colour lines by', strength: 'strength', use: 'use', part: 'part', contrast: 'Contrast', gamma: 'Gamma', plain: 'As it was taken', magnify: 'Residuals magnified',
  },
  tools: {
    title: 'Tools', look: 'Look and pick', band: 'Pick the lines in a box', draw: 'Draw a missing line', arc: 'Draw a missing curve', cut: 'Cut the part', split: 'Split a line', extend: 'Extend a line', merge: 'Merge two lines', remove: 'Remove the line',
    hint: {
      look: 'Click a part or a line. Wheel zooms, drag pans.', band: 'Drag a box about the part: VSS says which line in it is which.', draw: 'Drag along the edge: the line snaps to it.', arc: 'Click three points of the curve: it snaps to the edge and follows it.', cut: 'Point at the part, and click where it is to be cut.', split: 'Click where the line is to be split.',
      extend: 'Click beyond the end of a line: its nearer end moves there.', merge: 'Click two lines that are one edge.', remove: 'Click a line or a curve to remove it.',
      build: 'Click the line that shows the highlighted contour.', placed: 'Click any line of the part: its contour is known. Shift and drag takes a box.',
    } as Record<string, string>,
  },
  arcPoint: (n: number) => `Click the ${['first', 'second', 'last'][n]} of three points of the curve.`, notSnapped: 'No edge was found there: it stays as drawn, and counts little.',
  wouldCut: (along: string, [a, b]: [number, number]) => `Click: cuts its ${along} into ${a.toFixed(0)} and ${b.toFixed(0)} mm`, turnCut: 'Tab turns the cut', refusedCut: (why: string) => `Not here: ${why}.`,
  would: {
    remove: (circle: boolean) => `Click: removes this ${circle ? 'curve' : 'line'}`, split: ([a, b]: [number, number]) => `Click: splits this line into ${a.toFixed(0)} and ${b.toFixed(0)} px`, splitTooNear: 'Too near to the end of the line to split it.',
    mergeFirst: 'Click: takes this line as the first of two', mergeSecond: 'Click the other line.', merge: 'Click: makes one line of both', extendFirst: 'Click: takes this line; its nearer end then goes where you click', extend: 'Click: moves the end of the line here',
  },
  wouldSelect: (part: string) => `Click: selects ${part}`, wouldSelectLine: 'Click: selects this line',
  pointer: (u: number, v: number, g: number | null) => `u ${u.toFixed(1)}  v ${v.toFixed(1)}${g === null ? '' : `  grey ${g}`}`,
  zoom: (s: number) => `${Math.round(s * 100)} %`, fitView: 'Show the whole picture', zoomIn: 'Zoom in', zoomOut: 'Zoom out', previous: 'Previous picture', next: 'Next picture',
  overlap: (i: number, n: number) => `line ${i} of ${n} here: Tab or a held finger chooses`,
  chooseLine: 'Which of these lines?', lineHere: (i: number, px: number, part: string) => `line ${i}, ${px.toFixed(0)} px long${part ? `, of ${part}` : ''}`,
  parts: {
    none: 'No parts yet.', noneHint: 'Run the survey, or build a part by hand.', selectFirst: 'Select a part first.', source: { automatic: 'automatic', corrected: 'corrected', manual: 'by hand' },
    doubtful: 'doubtful', confirmed: 'confirmed', confirm: 'Confirm', unconfirm: 'Take back', correct: 'Correct lines', remove: 'Delete', refit: 'Fit its lines', refitHelp: 'Takes every line that lies on the part and fits it to them', measure: 'Measure', measureHelp: 'Measures its edges in the grey values of all pictures, as the survey does',
    kind: 'Other kind…', split: 'Split', splitHelp: 'Cuts it in two where you point at it in the picture', noSplit: 'Its kind cannot be cut into two of its kind', along: 'Cut its', merge: 'Merge with…', mergeNone: 'There is no other part of its kind.', size: 'Standard size', oneOf: (names: string[]) => `${names.join(' or ')}`, features: 'With', plain: 'nothing more', dimension: 'Dimension', value: 'mm', sigma: '± 2σ', notObservable: 'not observable', given: 'given',
    position: 'Position', yaw: 'Turned by', residual: 'Residual', seenIn: 'Used in', standsOn: 'Stands on', runnerUp: (kind: string, mine: number, other: number) => `Second best: ${kind} (${other.toFixed(0)} against ${mine.toFixed(0)})`,
    pictures: (n: number) => plural(n, 'picture'), lines: (n: number) => plural(n, 'line'), ground: 'the ground', total: (n: number) => plural(n, 'part'),
    origin: (o: string) => o,
  },
  queue: {
    title: 'What needs you', empty: 'Nothing is doubtful.', emptyHint: 'Every part is sure or confirmed.', next: 'Next doubtful part', doubtful: 'Little speaks for it.',
    hidden: (names: string[]) => `No picture shows its ${names.join(', ')}.`, unknown: (n: number) => `${plural(n, 'line')} here look like an object that no knowledge base describes.`,
  },
  build: {
    title: 'Build a part by hand', correct: (id: string) => `Correct ${id}`, chooseKind: 'What is it?', wouldPick: (name: string) => `Click: this line is ${name}`, wouldDrop: 'Click: drops this line', contourName: (circle: boolean, i: number) => `${circle ? 'rim' : 'edge'} ${i + 1}`, drawing: (kind: string) => `Contours of a ${kind}`, hiddenHere: ', hidden here', isPicked: ', picked', otherShape: (circle: boolean) => circle ? 'This contour is a rim: click a curved line.' : 'This contour is straight: click a straight line.', chooseFirst: 'Choose first what it is.', bandNeedsPart: 'A box picks lines for a part: press “New part by hand” first.', nothingBoxed: 'There is no line in that box which is not picked yet.', proposing: 'Looking which line is which…', misfit: (key: string) => `These lines do not fit as they are named. Press ${key}: VSS says which line is which.`,
    contourHint: 'Click a contour in the drawing, then its line in a picture. Or pick lines of the part in any order, one by one or in a box, and let VSS say which is which.',
    propose: 'Which line is which?', proposeHelp: 'VSS proposes the contour of each picked line', proposeFirst: 'Pick some lines of the part first, in any order.', proposal: 'This fits the lines best. Look at it in the pictures.', undecided: (n: number, another: boolean) => another ? `These ${n} lines do not decide: another reading is nearly as good. Compare the two, or pick one more line, in another direction or another picture.` : `${n === 1 ? 'This line does' : `These ${n} lines do`} not say yet where it stands: pick more, in another direction or another picture.`, accept: 'Accept', other: (i: number, n: number) => `Show the other (${i} of ${n})`, back: 'As before', contourOf: (name: string) => `Contour of ${name}`,
    nextContour: 'Next contour', picks: (n: number) => plural(n, 'line') + ' picked', collect: 'Take all lines that fit', save: 'Save part', stop: 'Stop', live: (ms: number) => `fitted in ${ms.toFixed(0)} ms`,
    notPlaced: 'Not placed yet: pick more edges that run in different directions.', hint: (d: string, picture: string) => `${d} is not observable yet. The highlighted contour in ${picture} would show it.`, show: 'Show it',
    drop: 'Drop this line', dropLast: 'Drop the last line', fix: 'Give mm', fixHelp: 'A dimension that you know: it stays as you give it', fixLabel: (d: string) => `Give ${d} in mm`, noLength: (text: string) => `“${text}” is no length in mm.`, standsOn: 'Stands on', pose: 'Lies', rms: (v: number | null) => `residual ${v === null ? '?' : v.toFixed(2)} px`, taken: (name: string) => `Taken as ${name}, which lies there.`, lines: 'Lines picked',
    start: 'New part by hand', noKinds: 'The knowledge base of this survey is empty.',
  },
  parameters: { title: 'Parameters of the next run', reset: 'Default', changed: 'changed', search: 'Find a parameter', range: (a: number, b: number, u: string) => `${a} to ${b}${u ? ' ' + u : ''}`, rerun: 'Run with these', none: 'No parameter matches.', lastRun: 'What the last run changed' },
  cameras: {
    title: 'Cameras of this survey', camera: 'Camera', size: 'Size', residual: 'Residual', unknown: 'not known', own: "These are the survey's own cameras.", taken: (job: string) => `Taken over from ${job}.`, useOwn: "Use the survey's own", rerun: 'The parts were found with other cameras: run the survey again.',
    calibrate: 'Calibrate', job: 'Job', noJobs: "There is no calibration.toml in this survey's folder or in a folder beside it. Put one there with its pictures, and look again.", look: 'Look again', model: 'Lens model', models: { weng: 'Weng (ten parameters)', opencv: "OpenCV's" } as Record<string, string>,
    options: 'Parameters', start: 'Calibrate', last: (job: string) => `Last calibration: ${job}`, views: (n: number) => plural(n, 'view'), placed: 'lens and place', lensOnly: 'lens', report: 'Show the report', json: 'calibration.json', file: (id: string) => `${id}.toml`, use: 'Use these cameras', inUse: 'In use',
    warnings: 'Warnings', findings: 'What was found', what: 'Calibrated',
  },
  history: {
    title: 'Who changed what', name: 'Your name', action: { edit: '', undo: 'undid: ', redo: 'did again: ' }, more: 'Earlier', changes: 'What changed', none: 'Nothing was changed yet.',
    added: 'added', removed: 'removed', changed: 'changed', noChanges: 'No part changed.', compare: 'Show in the pictures how it was', endCompare: 'Dotted white: before. Hide it',
  },
  panelHelp: {
    parts: ['01-normal-operation.md', 'Read a result'], todo: ['01-normal-operation.md', 'Go through what is doubtful'], build: ['01-normal-operation.md', 'Build a part by hand'],
    parameters: ['01-normal-operation.md', 'Run the survey'], cameras: ['calibration.md', 'Calibrate from the page'], history: ['01-normal-operation.md', 'Undo'], help: ['', ''],
  } as Record<string, [string, string]>,
  help: { title: 'Help', here: 'Help for this panel', parameter: 'Parameter', search: 'Search the manual', none: 'Nothing found.', back: 'All pages', empty: 'This program was built without its manual.' },
  scene: {
    label: (n: number) => `3D view of ${plural(n, 'part')}`, direction: 'Direction of the section', wouldSelect: (part: string) => `Click: selects ${part}`, at: (mm: number) => `${mm.toFixed(0)} mm`, whole: 'whole',
    reset: 'Reset view', top: 'From above', section: 'Section', across: { z: 'from above', x: 'along x', y: 'along y' } as Record<string, string>, measure: 'Measure', measureHint: 'Click two vertices.', cameras: 'Cameras', empty: 'Nothing to show yet.', result: (d: number, s: number | null, reduced: boolean) => `${d.toFixed(2)} mm${s === null ? '' : ` ± ${(2 * s).toFixed(2)} mm (2σ)`}${reduced ? ' at 20 °C' : ''}`,
    delta: (d: number[]) => `Δx ${d[0].toFixed(1)}  Δy ${d[1].toFixed(1)}  Δz ${d[2].toFixed(1)} mm`, failed: 'The 3D view could not be loaded. Load the page again.', seams: (n: number) => plural(n, 'seam') + ' (red)', noWebgl: 'This browser has no WebGL: the 3D view is drawn as lines.',
  },
  guideSteps: [
    { key: 'look', title: 'Look at the pictures', text: 'The strip on the left shows every picture. Click some of them; zoom with the wheel, drag to move.' },
    { key: 'run', title: 'Run the survey', text: 'The button “Run survey” finds lines, then parts. The bar at the top shows how far it is.' },
    { key: 'select', title: 'Look at a part', text: 'Click a part in a picture, in the list or in 3D: it lights up everywhere, with its dimensions and how sure they are.' },
    { key: 'doubt', title: 'Go through what is doubtful', text: 'Press N, again and again: each part that needs a person comes up and says why. Confirm it, correct its lines, or delete it. Where all is sure, “To do” says so.' },
    { key: 'edit', title: 'Change something, and undo it', text: 'Confirm or delete a part, then press Ctrl+Z. Everything can be undone, also tomorrow.' },
    { key: 'export', title: 'Take the result with you', text: '“Export” writes the product data: parts, dimensions, sigmas; a report for people; models for CAD.' },
  ],
  guideDone: 'You have seen all of it. The manual is under Help.', close: 'Close', skip: 'Close the guide', step: (i: number, n: number) => `Step ${i} of ${n}`,
  keysHint: 'Click a key to give another one to what it does. This browser remembers it.', pressKey: 'Press a key', noKey: 'none', usualKeys: 'Usual keys', changeKey: (what: string) => `Other key for: ${what}`, keyTaken: (key: string) => `${key} always means the same.`,
  keys: {
    keys: 'These shortcuts', picture: 'Picture', scene: '3D', both: 'Picture and 3D', previous: 'Previous picture', next: 'Next picture', zoomIn: 'Zoom in', zoomOut: 'Zoom out', whole: 'Whole picture',
    left: 'Look left', right: 'Look right', up: 'Look up', down: 'Look down', grey: 'Grey picture', lines: 'Lines', parts: 'Parts', hidden: 'Hidden edges', residuals: 'Residuals', vertices: 'Vertices', colour: 'Colour of the lines',
    doubtful: 'Next doubtful part', confirm: 'Confirm the selected part', build: 'New part by hand', correct: 'Correct lines of the selected part', collect: 'Take all lines that fit', propose: 'Propose which picked line is which', draw: 'Draw a missing line', curve: 'Draw a missing curve', split: 'Split a line', extend: 'Extend a line', merge: 'Merge two lines',
    delete: 'Delete the part, or remove the line', band: 'Pick the lines in a box', measure: 'Measure the selected part', refit: 'Fit the lines of the selected part', kind: 'Other kind of the selected part', cut: 'Split the selected part in two', unite: 'Merge the selected part with another',
    run: 'Run the survey, or cancel it', export: 'Export', distance: 'Measure a distance in 3D', section: 'Section in 3D', above: '3D from above', cameras: 'Cameras in 3D',
    panelParts: 'Panel: Parts', panelTodo: 'Panel: To do', panelBuild: 'Panel: By hand', panelParameters: 'Panel: Parameters', panelCameras: 'Panel: Cameras', panelHistory: 'Panel: History', guide: 'First survey, step by step',
  } as Record<string, string>,
  fixedKeys: [
    ['Enter', 'Save the part that is being built; accept a proposal'], ['Shift drag', 'Picks the lines in a box'], ['Tab', 'Next line where lines lie on each other; turns a cut (pointer over the picture)'], ['Long press', 'On a touch screen: chooses among lines that lie on each other'], ['Ctrl+Z', 'Undo'], ['Ctrl+Y', 'Redo'], ['F1', 'Help'], ['Esc', 'Back'],
  ] as [string, string][],
};

const stepNames: Record<string, string> = { marks: 'Finding marks, picture', cube: 'Placing cameras, camera', start: 'Starting', lines: 'Finding lines, picture', reconstruct: 'Measuring, step', knowledge: 'Reading knowledge', pictures: 'Reading picture', hypotheses: 'Identifying, step', report: 'Writing' };
