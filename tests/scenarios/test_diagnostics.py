# ruff: noqa: E501
"""Scenarios that are refused: the words and places of all faults, for each section.

A case is one or more changes of the minimal scenario, `old -> new`, and below them, indented, the faults of the
result: line, column, field, what was expected and what came.
"""

from __future__ import annotations

import pytest

from scenarios.minimal import changed
from vedette.errors import ScenarioError
from vedette.scenarios import parse_scenario

# Time, region, motion, survival, births and targets.
WORLD = r"""
name: small -> nane: small
    1:1: name: required key is missing
    1:1: nane: expected one of birth, classes, coastline, control, description, estimator, filter, format, fusion, metrics, motion, name, network, origin, ospa, planners, recording, region, sensor_defaults, sensors, survival, targets, time, undetected, got an unknown key (did you mean name?)
name: small -> name: ''
    1:7: name: expected a name of one or more printable characters, got ""
name: small -> name: small\nformat: 2
    2:9: format: expected 1, got 2
name: small -> name: small\ndescription: 3
    2:14: description: expected a word or text in quotes, got 3
num_steps: 20 -> num_steps: 20.5
    2:19: time.num_steps: expected a whole number, got 20.5
num_steps: 20 -> num_steps: 0
    2:19: time.num_steps: expected a number of at least 1, got 0
step_period: 0.5 -> step_period: fast
    2:36: time.step_period: expected a number, got "fast"
num_steps: 20, step_period -> step_period
    2:1: time.num_steps: required key is missing
x_max: 100.0 -> x_max: -200.0
    3:32: region.x_max: expected a number above x_min, -100, got -200.0
y_max: 50.0 -> y_max: .nan
    3:60: region.y_max: expected a finite number, got nan
region: {x_min: -100.0, x_max: 100.0, y_min: -50.0, y_max: 50.0} -> region: [1, 2]
    3:9: region: expected a mapping, got a list of 2
kind: constant_velocity -> kind: constant_speed
    4:16: motion.kind: expected one of constant_acceleration, constant_turn, constant_velocity, constant_velocity_height, coordinated_turn, modes, ornstein_uhlenbeck, random_walk, custom, got "constant_speed" (did you mean constant_turn?)
kind: constant_velocity, sigma_v -> sigma_v
    4:9: motion: expected a mapping with kind: one of constant_acceleration, constant_turn, constant_velocity, constant_velocity_height, coordinated_turn, modes, ornstein_uhlenbeck, random_walk, custom, got no kind
sigma_v: 1.0 -> sigma_v: -1.0
    4:44: motion.sigma_v: expected a number of at least 0, got -1.0
{kind: constant_velocity, sigma_v: 1.0} -> {kind: coordinated_turn}
    9:30: birth.sites[0].mean: expected 5 numbers, as a state under motion has, got a list of 4
    9:57: birth.sites[0].std: expected 5 numbers, as a state under motion has, got a list of 4
    13:15: targets.tracks[0].state: expected 5 numbers, as a state under motion has, got a list of 4
{kind: constant_velocity, sigma_v: 1.0} -> {kind: custom, function: nowhere, components: [px, py, vx, vy]}
    4:34: motion.function: expected "package.module:attribute" or "file.py:attribute", got "nowhere"
{kind: constant_velocity, sigma_v: 1.0} -> {kind: custom, function: 'absent.py:motion', components: [px, py, vx, vy]}
    4:34: motion.function: expected a file, relative to the scenario file, got "absent.py": no such file
{kind: constant_velocity, sigma_v: 1.0} -> {kind: custom, function: 'no_such_module_here:motion', components: [px, py, vx, vy]}
    4:34: motion.function: expected a module that Python finds, got "no_such_module_here"
probability: 0.95 -> probability: 95
    5:41: survival.probability: expected a number of at most 1, got 95
steps: [1, 5] -> steps: [1, 1, 21]
    7:14: birth.steps[1]: expected each step once, got 1 again
    7:17: birth.steps[2]: expected a step up to the last, 20, got 21
steps: [1, 5] -> steps: always
    7:10: birth.steps: expected every or a list, got "always"
existence: 0.1 -> existence: 1.0
    9:19: birth.sites[0].existence: expected a number below 1, got 1.0
std: [5.0, 5.0, 2.0, 2.0] -> std: [5.0, 5.0, 0.0, 2.0]
    9:68: birth.sites[0].std[2]: expected a number above 0, got 0.0
mean: [0.0, 0.0, 0.0, 0.0] -> mean: [0.0, 0.0]
    9:30: birth.sites[0].mean: expected 4 numbers, as a state under motion has, got a list of 2
, std: [5.0, 5.0, 2.0, 2.0]} -> }
    9:7: birth.sites[0]: expected either std or cov, got neither
std: [5.0, 5.0, 2.0, 2.0] -> cov: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 2], [0, 0, 2, 1]]
    9:57: birth.sites[0].cov: expected a positive definite matrix, got correlations with a least eigenvalue of -1
std: [5.0, 5.0, 2.0, 2.0] -> cov: [[1, 0], [0, 1]]
    9:57: birth.sites[0].cov: expected 4 rows of 4 numbers, got a list of 2
sites:\n    - {existence: 0.1, mean: [0.0, 0.0, 0.0, 0.0], std: [5.0, 5.0, 2.0, 2.0]}\ntargets
-> sites:\n    []\ntargets
    9:5: birth.sites: expected at least one site, or from_measurements, got neither
end_step: 18 -> end_step: 18, std: [1.0, -1.0, 0.0, 0.0]
    13:78: targets.tracks[0].std[1]: expected a number of at least 0, got -1.0
end_step: 18 -> end_step: 18, std: [1.0]
    13:72: targets.tracks[0].std: expected 4 numbers, as a state under motion has, got a list of 1
end_step: 18 -> end_step: 1
    13:63: targets.tracks[0].end_step: expected a step from start_step, 2, on, got 1
end_step: 18 -> end_step: 21
    13:63: targets.tracks[0].end_step: expected a step up to the last, 20, got 21
state: [1.0, 2.0, 0.5, -0.5] -> state: [1.0, 2.0, 0.5]
    13:15: targets.tracks[0].state: expected 4 numbers, as a state under motion has, got a list of 3
state: [1.0, 2.0, 0.5, -0.5] -> state: 1.0, 2.0
    13:15: targets.tracks[0].state: expected a list, got 1.0
    13:20: targets.tracks[0]: expected a word as key, got 2.0
targets:\n  kind: scripted\n  tracks:\n    - {state: [1.0, 2.0, 0.5, -0.5], start_step: 2, end_step: 18}
-> targets:\n  kind: recorded\n  path: nowhere.csv
    12:9: targets.path: expected a file, relative to the scenario file, got "nowhere.csv": no such file
"""

# Sensors.
SENSORS = r"""
targets:\n  kind: scripted\n  tracks:\n    - {state: [1.0, 2.0, 0.5, -0.5], start_step: 2, end_step: 18}
-> targets:\n  {kind: recorded, path: ships.txt, columns: {longitude: lon}}
    11:26: targets.path: expected a file that ends with .csv, .parquet, .nmea, .ais, .ast, .asterix, .raw, .db3, .mcap, got "ships.txt"
    11:46: targets.columns: expected longitude and latitude together, got only longitude
std: [0.02, 3.0] -> std: [0.02]
    15:32: sensor_defaults.noise.std: expected 2 numbers, as a bearing_range measurement has, got a list of 1
std: [0.02, 3.0] -> std: [0.02, -3.0]
    15:39: sensor_defaults.noise.std[1]: expected a number above 0, got -3.0
kind: constant, std: [0.02, 3.0] -> kind: range_dependent, sigma_bearing: 1
    15:34: sensor_defaults.noise.sigma_bearing: expected one of eta_bearing, eta_range, extent, kind, sigma_altitude, sigma_bearing_deg, sigma_elevation_deg, sigma_range, sigma_range_rate, got an unknown key (did you mean sigma_bearing_deg?)
sensor_defaults:\n  noise: { -> sensor_defaults:\n  nose: {
    15:3: sensor_defaults.nose: expected one of bias, budget, classification, clutter, compass, correlation, detection, extent, heading_deg, height, measurement, noise, platform, price, scans, signal, stationary_until_first_decision, switchable, true_parameters, turn, got an unknown key (did you mean noise?)
position: [0.0, 40.0] -> position: [0.0, 40.0, 1.0]
    17:29: sensors[0].position: expected a list of 2, got a list of 3
heading_deg: 4.0 -> platform: {kind: waypoints, speed: 1.0, points: [[0.0, 1.0], [2.0]]}
    17:103: sensors[0].platform.points[1]: expected a list of 2, got a list of 1
position: [0.0, 40.0], heading_deg -> heading_deg
    17:5: sensors[0].position: required key is missing
name: south -> name: north
    18:12: sensors[1].name: expected each name once, got "north" again
heading_deg: 4.0 -> platform: {kind: heading, speed: -4.0}
    17:75: sensors[0].platform.speed: expected a number of at least 0, got -4.0
heading_deg: 4.0 -> platform: {kind: heading, speed: 4.0, headings_deg: []}
    17:94: sensors[0].platform.headings_deg: expected a list of at least 1, got an empty list
heading_deg: 4.0 -> platform: {kind: heading}
    17:52: sensors[0].platform: expected either speed or speeds, got neither
heading_deg: 4.0 -> platform: {kind: hedding, speed: 4.0}
    17:59: sensors[0].platform.kind: expected one of camera, grid_moves, heading, stationary, waypoints, custom, got "hedding" (did you mean heading?)
heading_deg: 4.0 -> speed: 4.0
    17:42: sensors[0].speed: expected one of bias, budget, classification, clutter, compass, correlation, detection, extent, heading_deg, height, measurement, name, noise, platform, position, price, scans, signal, stationary_until_first_decision, switchable, true_parameters, turn, got an unknown key (the platform of a sensor has it: `platform: {kind: heading, speed: 50.0, headings_deg: [0, 90]}`)
heading_deg: 4.0 -> platform: {kind: camera, half_width_deg: 200.0, pointings_deg: [0.0], platform: {kind: camera}}
    17:83: sensors[0].platform.half_width_deg: expected a number of at most 180, got 200.0
    17:129: sensors[0].platform.platform.kind: expected one of stationary, heading, grid_moves, waypoints, custom, got "camera"
heading_deg: 4.0 -> detection: {kind: camera, probability: 0.9, max_range: 50.0}
    17:5: sensors[0].platform: expected a camera, as its detection is a camera's, got stationary
heading_deg: 4.0 -> measurement: {kind: position}, noise: {kind: range_dependent}
    17:80: sensors[0].noise: expected constant, by_axis or custom noise for a position measurement, got range_dependent noise
heading_deg: 4.0 -> measurement: {kind: range_only}
    15:32: sensor_defaults.noise.std: expected 1 number, as a range_only measurement has, got a list of 2
heading_deg: 4.0 -> detection: {kind: limited_sector, probability: 0.9, max_range: 50.0, half_width_deg: 0}
    17:127: sensors[0].detection.half_width_deg: expected a number above 0, got 0
heading_deg: 4.0 -> detection: {kind: limited_range, probability: 1.1, max_range: -1}
    17:88: sensors[0].detection.probability: expected a number of at most 1, got 1.1
    17:104: sensors[0].detection.max_range: expected a number above 0, got -1
heading_deg: 4.0 -> clutter: {kind: measurement_space, rate: 5, low: [-3.0, 0.0], high: [3.0, -1.0]}
    17:116: sensors[0].clutter.high[1]: expected a number above low, 0, got -1.0
heading_deg: 4.0 -> clutter: {kind: region, rate: lots}
    17:72: sensors[0].clutter.rate: expected a number, got "lots"
heading_deg: 4.0 -> noise: {kind: by_axis, std: [1.0, 1.0], quadratic_growth: [0.0, 1e-5]}
    17:49: sensors[0].noise: expected range_dependent, constant or custom noise for a bearing_range measurement, got by_axis noise
heading_deg: 4.0
-> detection: {kind: soft_sector, probability: 0.9, max_range: 50.0, half_width_deg: 200, range_slope: 0}
    17:124: sensors[0].detection.half_width_deg: expected a number of at most 180, got 200
    17:142: sensors[0].detection.range_slope: expected a number above 0, got 0
heading_deg: 4.0 -> clutter: {kind: around_sensor, radius: 10, half_side: 10}
    17:51: sensors[0].clutter: expected either radius or half_side, got both
heading_deg: 4.0
-> measurement: {kind: bearing_only}, noise: {kind: constant, std: [0.1]}, clutter: {kind: around_sensor, radius: 10}
    17:123: sensors[0].clutter: expected region, measurement_space or custom clutter for a bearing_only measurement, got around_sensor clutter
heading_deg: 4.0 -> true_parameters: {measurement: {kind: position}}
    17:80: sensors[0].true_parameters.measurement.kind: expected bearing_range or custom, as the filter takes it for that, got "position"
heading_deg: 4.0
-> true_parameters: {noise: {kind: constant, std: [1.0]}, clutter: {kind: measurement_space, low: [0.0, 9.0], high: [1.0, 8.0]}}
    17:89: sensors[0].true_parameters.noise.std: expected 2 numbers, as a bearing_range measurement has, got a list of 1
    17:161: sensors[0].true_parameters.clutter.high[1]: expected a number above low, 9, got 8.0
heading_deg: 4.0 -> true_parameters: {first_detection: {kind: camera, probability: 0.9, max_range: 9.0}}
    17:5: sensors[0].platform: expected a camera, as its detection is a camera's, got stationary
heading_deg: 4.0
-> measurement: {kind: range_only}, noise: {kind: constant, std: [1.0]}, true_parameters: {detection_of: measurement}
    17:144: sensors[0].true_parameters.detection_of: expected state, as a range_only measurement does not say where the target is, got "measurement"
heading_deg: 4.0 -> scans: {every: 3, first: 4}
    17:67: sensors[0].scans.first: expected a step up to every, 3, got 4
heading_deg: 4.0 -> scans: {every: 30, first: 21}
    17:68: sensors[0].scans.first: expected a step up to the last, 20, got 21
"""

# Filter, fusion, estimates, control and score.
TRACKING = r"""
sensors:\n  - {name: north, position: [0.0, 40.0], heading_deg: 4.0}\n  - {name: south, position: [0.0, -40.0]}
-> sensors: []
    16:10: sensors: expected a list of at least 1, got an empty list
kind: m_delta_glmb -> kind: m-delta-glmb
    19:16: filter.kind: expected one of delta_glmb, m_delta_glmb, lmb, factored_glmb, phd, cphd, cb_member, custom, got "m-delta-glmb" (did you mean m_delta_glmb?)
kind: m_delta_glmb -> kind: m_delta_glmb, limits: {max_hypotheses: 0, gate_probability: 0}
    19:55: filter.limits.max_hypotheses: expected a number of at least 1, got 0
    19:76: filter.limits.gate_probability: expected a number above 0, got 0
kind: m_delta_glmb -> kind: lmb, assignment: {kind: gibbs, num_samples: 10}
    19:40: filter.assignment.kind: expected belief_propagation or ranked or custom, as the filter is lmb, got "gibbs"
    20:16: fusion.kind: expected sequential, parallel, clmb, arithmetic_average, central or none, as the filters are lmb, got "cm_delta_glmb"
kind: m_delta_glmb -> kind: cphd, assignment: {kind: gibbs}, limits: {max_existence: 1.0, max_intensity_components: 0}
    19:16: filter.kind: expected a filter with labels by which to fuse, as there are 2 sensors, got "cphd"
    19:41: filter.assignment.kind: expected ranked, as the filter is cphd, got "gibbs"
    19:73: filter.limits.max_existence: expected a number below 1, got 1.0
    19:104: filter.limits.max_intensity_components: expected a number of at least 1, got 0
    21:19: estimator.kind: expected map, as cphd filters have no labels, got "marginal"
4.0}\n  - {name: south, position: [0.0, -40.0]}\nfilter: {kind: m_delta_glmb}\nfusion: {kind: cm_delta_glmb, weights: [0.5, 0.5]}\nestimator: {kind: marginal, threshold: 0.6}
-> 4.0}\nfilter: {kind: phd}\nfusion: {kind: clmb}
    19:16: fusion.kind: expected none, as phd filters have no labels by which to fuse, got "clmb"
filter: {kind: m_delta_glmb}\nfusion: {kind: cm_delta_glmb, weights: [0.5, 0.5]}
-> filter: {kind: delta_glmb, assignment: {kind: gibbs}}\nfusion: {kind: central, feedback: true}
    19:47: filter.assignment.kind: expected ranked, as one filter takes the scans of all sensors, got "gibbs"
    20:35: fusion.feedback: expected false, as nothing is fused while tracking, got true
kind: m_delta_glmb -> kind: m_delta_glmb, assignment: murty
    19:42: filter.assignment: expected a mapping, got "murty"
weights: [0.5, 0.5] -> weights: [0.5, 0.4]
    20:40: fusion.weights: expected weights with sum 1, got a sum of 0.9
{kind: cm_delta_glmb, weights: [0.5, 0.5]} -> {weights: [0.5, 0.5]}
    20:9: fusion: expected a mapping with kind: one of sequential, parallel, clmb, cm_delta_glmb, arithmetic_average, central, none, custom, got no kind
weights: [0.5, 0.5] -> weights: [1.0]
    20:40: fusion.weights: expected as many weights as sensors, 2, got a list of 1
weights: [0.5, 0.5] -> weights: [1.5, -0.5]
    20:41: fusion.weights[0]: expected a number of at most 1, got 1.5
    20:46: fusion.weights[1]: expected a number of at least 0, got -0.5
kind: cm_delta_glmb, weights: [0.5, 0.5] -> kind: none
    20:16: fusion.kind: expected a fusion, as there are 2 sensors, got "none"
weights: [0.5, 0.5] -> mixture_power: quadrature, limits: {max_components: 100}
    20:83: fusion.limits.max_components: expected a number whose power by 2 sensors is at most max_combinations, 4096, got 100
kind: cm_delta_glmb, weights -> kind: clmb, feedback: true, weights
    20:32: fusion.feedback: expected false, as m_delta_glmb filters cannot go on from an LMB, got true
kind: cm_delta_glmb, weights: [0.5, 0.5] -> kind: parallel, field_of_view_weighting: true, matching: assignment
    20:16: fusion.kind: expected sequential or another, as parallel is of lmb or factored_glmb filters, and these are m_delta_glmb, got "parallel"
    20:51: fusion.field_of_view_weighting: expected false, as parallel does not weigh labels (clmb and arithmetic_average do), got true
    20:67: fusion.matching: expected labels, as under parallel all sensors share them, got "assignment"
kind: cm_delta_glmb, weights: [0.5, 0.5] -> kind: cm_delta_glmb, matching: assignment, feedback: true
    20:41: fusion.matching: expected labels, as with feedback all sensors share them, got "assignment"
kind: cm_delta_glmb, weights: [0.5, 0.5] -> kind: arithmetic_average, feedback: true
    20:46: fusion.feedback: expected false, as m_delta_glmb filters cannot go on from an LMB, got true
kind: cm_delta_glmb, weights: [0.5, 0.5] -> kind: sequential, feedback: true
    20:38: fusion.feedback: expected false, as nothing is fused while tracking, got true
threshold: 0.6 -> threshold: 1.0
    21:40: estimator.threshold: expected a number below 1, got 1.0
kind: marginal, threshold: 0.6 -> kind: least_gospa, cutoff: 0, order: 0.5
    21:40: estimator.cutoff: expected a number above 0, got 0
    21:50: estimator.order: expected a number of at least 1, got 0.5
decision_steps: [4, 8] -> decision_steps: [4, 25]
    22:31: control.decision_steps[1]: expected a step up to the last, 20, got 25
decision_steps: [4, 8] -> decision_steps: [8, 4]
    22:31: control.decision_steps[1]: expected more than the one before it, 8, got 4
decision_steps: [4, 8] -> confidence: 1.0, indifference: 1, max_samples: 8, max_seconds: 0
    22:23: control.confidence: expected a number below 1, got 1.0
    22:42: control.indifference: expected a number below 1, got 1
    22:58: control.max_samples: expected a number of at least 24, got 8
    22:74: control.max_seconds: expected a number above 0, got 0
decision_steps: [4, 8] -> indifference: 0.01, max_samples: 100
    22:25: control.indifference: expected confidence beside it, such as 0.95, got 0.01
    22:44: control.max_samples: expected confidence beside it, such as 0.95, got 100
decision_steps: [4, 8] -> decision_times: [3.0, 3.2, 100]
    22:33: control.decision_times[1]: expected the time of a scan: 2 s and every 0.5 s after it, got 3.2
    22:38: control.decision_times[2]: expected a time from 2 to 11.5 s, got 100.0
decision_steps: [4, 8] -> decision_steps: [4], decision_times: [3.0]
    22:10: control: expected one of decision_steps, decision_times, decision_every, got decision_steps and decision_times
decision_steps: [4, 8] -> horizon_steps: 0, horizon_period: 0.0
    22:26: control.horizon_steps: expected a number of at least 1, got 0
    22:45: control.horizon_period: expected a number above 0, got 0.0
decision_steps: [4, 8] -> actions_deg: [0, 90]
    22:11: control.actions_deg: expected one of association, confidence, constraints, decision_every, decision_steps, decision_times, detection_threshold, explain, horizon_period, horizon_steps, ideal_measurements, indifference, limits, lookahead, max_samples, max_seconds, num_samples, others, reward, search, undetected_target_value, got an unknown key (the platform of a sensor has it: `platform: {kind: heading, speed: 50.0, headings_deg: [0, 90]}`)
decision_steps: [4, 8] -> reward: {kind: cauchy_schwarz, unit_volume: 0}
    22:55: control.reward.unit_volume: expected reference or a number above 0, got 0
decision_steps: [4, 8] -> reward: {kind: renyi, order: 1}
    22:40: control.reward.order: expected a number other than 1, got 1
decision_steps: [4, 8] -> reward: {kind: entropy}
    22:26: control.reward.kind: expected one of cardinality_variance, cauchy_schwarz, expected_gospa, expected_loss, kullback_leibler, peecs, renyi, custom, got "entropy"
decision_steps: [4, 8] -> ideal_measurements: perfect, detection_threshold: 2
    22:31: control.ideal_measurements: expected one of ideal, expected, sampled, got "perfect"
    22:61: control.detection_threshold: expected a number of at most 1, got 2
last_scan: 20 -> last_scan: 4
    23:48: ospa.last_scan: expected a scan from first_scan, 5, on, got 4
last_scan: 20 -> last_scan: 30
    23:48: ospa.last_scan: expected a step up to the last, 20, got 30
cutoff: 50.0 -> cutoff: 0, order: 0.5
    23:16: ospa.cutoff: expected a number above 0, got 0
    23:26: ospa.order: expected a number of at least 1, got 0.5
"""

# Networks and births from measurements.
NETWORKS = r"""
kind: m_delta_glmb -> kind: lmb
fusion: {kind: cm_delta_glmb, weights: [0.5, 0.5]} -> fusion: {kind: sequential}\nnetwork: {consensus_rounds: 3}
    21:29: network.consensus_rounds: expected none, as under sequential sensors send scans, of which there is no average, got 3
kind: m_delta_glmb -> kind: lmb
fusion: {kind: cm_delta_glmb, weights: [0.5, 0.5]} -> fusion: {kind: parallel}\nnetwork: {delay: 2}
    21:18: network.delay: expected 0, as parallel divides by the prediction of the same time, got 2
kind: m_delta_glmb -> kind: lmb
fusion: {kind: cm_delta_glmb, weights: [0.5, 0.5]} -> fusion: {kind: clmb}\nnetwork: {}
    20:1: fusion.feedback: expected true, as sensors of a network go on from what they have fused, got false
kind: m_delta_glmb -> kind: lmb
fusion: {kind: cm_delta_glmb, weights: [0.5, 0.5]} -> fusion: {kind: parallel}\nnetwork: {consensus_rounds: 3, delay: 2}
    21:39: network.delay: expected none with consensus_rounds, got 2
    21:39: network.delay: expected 0, as parallel divides by the prediction of the same time, got 2
kind: m_delta_glmb -> kind: lmb
fusion: {kind: cm_delta_glmb, weights: [0.5, 0.5]} -> fusion: {kind: parallel}\nnetwork: {link_loss_probability: 1.0}
    21:34: network.link_loss_probability: expected a number below 1, got 1.0
kind: m_delta_glmb -> kind: lmb
fusion: {kind: cm_delta_glmb, weights: [0.5, 0.5]} -> fusion: {kind: clmb}
5]\n  sites:\n    - {existence: 0.1, mean: [0.0, 0.0, 0.0, 0.0], std: [5.0, 5.0, 2.0, 2.0]}\ntargets
-> 5]\n  sites:\n    - {existence: 0.1, mean: [0.0, 0.0, 0.0, 0.0], std: [5.0, 5.0, 2.0, 2.0]}\n  from_measurements: {expected: 0.4, max_existence: 0.1, std: [9.0, 8.0, 3.0, 2.0]}\ntargets
    21:1: fusion.matching: expected assignment, as without feedback sensors make labels of their own from their measurements, got "labels"
kind: m_delta_glmb -> kind: lmb
fusion: {kind: cm_delta_glmb, weights: [0.5, 0.5]} -> fusion: {kind: sequential}
5]\n  sites:\n    - {existence: 0.1, mean: [0.0, 0.0, 0.0, 0.0], std: [5.0, 5.0, 2.0, 2.0]}\ntargets
-> 5]\n  from_measurements: {expected: 0.4, max_existence: 0.1, std: [9.0, 8.0, 3.0]}\ntargets
    8:63: birth.from_measurements.std: expected 4 numbers, as a state under motion has, got a list of 3
kind: m_delta_glmb -> kind: lmb
fusion: {kind: cm_delta_glmb, weights: [0.5, 0.5]} -> fusion: {kind: sequential}
5]\n  sites:\n    - {existence: 0.1, mean: [0.0, 0.0, 0.0, 0.0], std: [5.0, 5.0, 2.0, 2.0]}\ntargets
-> 5]\n  from_measurements: {expected: 0.4, max_existence: 0.1, std: [0.0, 8.0, 3.0, 2.0]}\ntargets
    8:64: birth.from_measurements.std[0]: expected a number above 0, got 0.0
kind: m_delta_glmb -> kind: lmb
fusion: {kind: cm_delta_glmb, weights: [0.5, 0.5]} -> fusion: {kind: sequential}
5]\n  sites:\n    - {existence: 0.1, mean: [0.0, 0.0, 0.0, 0.0], std: [5.0, 5.0, 2.0, 2.0]}\ntargets
-> 5]\n  from_measurements: {expected: 0.4, max_existence: 0.1, std: [9.0, 8.0, 3.0, 2.0]}\ntargets
noise: {kind: constant, std: [0.02, 3.0]} -> measurement: {kind: bearing_only}\n  noise: {kind: constant, std: [0.02]}
    14:23: sensor_defaults.measurement.kind: expected a measurement that says where a target is, for birth.from_measurements, got "bearing_only"
"""

# Targets not found yet.
UNDETECTED = r"""
last_scan: 20} -> last_scan: 20}\nundetected: {cell_size: 0.0, expected: 5.0, speed: 1.0}
    24:25: undetected.cell_size: expected a number above 0, got 0.0
last_scan: 20} -> last_scan: 20}\nundetected: {expected: 5.0, speed: 1.0}
    24:1: undetected.cell_size: required key is missing
last_scan: 20} -> last_scan: 20}\nundetected: {cell_size: 9.0, expected: -1.0, speed: 1.0}
    24:40: undetected.expected: expected a number of at least 0, got -1.0
last_scan: 20} -> last_scan: 20}\nundetected: {cell_size: 9.0, expected: 1.0, speed: 1.0, birth_density: sea}
    24:72: undetected.birth_density: expected one of uniform, boundary, got "sea"
last_scan: 20} -> last_scan: 20}\nundetected: {cell_size: 0.1, expected: 1.0, speed: 1.0}
    24:25: undetected.cell_size: expected at least 0.285, as at most 250,000 cells may fill the region, got 0.1
last_scan: 20} -> last_scan: 20}\nundetected: {cell_size: 9.0, expected: 1.0, speed: 1.0, birth_rate: learnt}
    24:69: undetected.birth_rate: expected a number, as only one belief of all scans by filter.kind factored_glmb or lmb with births: poisson learns it, got "learnt"
last_scan: 20} -> last_scan: 20}\nundetected: {cell_size: 9.0, expected: 1.0, speed: 1.0, birth_rate: known}
    24:69: undetected.birth_rate: expected a number or learnt, got "known"
last_scan: 20} -> last_scan: 20}\nundetected: {cell_size: 9.0, expected: 1.0, speed: 1.0, prior_rate: 0.1}
    24:69: undetected.prior_rate: expected none, as birth_rate is not learnt, got 0.1
last_scan: 20}
-> last_scan: 20}\nundetected: {cell_size: 9.0, expected: 1.0, speed: 1.0, region: {x_min: 0.0, x_max: 0.0, y_min: 0.0, y_max: 1.0}}
    24:85: undetected.region.x_max: expected a number above x_min, 0, got 0.0
control: {decision_steps -> control: {undetected_target_value: 3.0, decision_steps
    22:36: control.undetected_target_value: expected 0, or a section `undetected`, which says where such targets may be, got 3.0
"""

# Searches, constraints and decisions ahead.
CONTROL = """
decision_steps: [4, 8] -> search: {kind: annealing}
    22:26: control.search.kind: expected one of automatic, coordinate_ascent, cross_entropy, exhaustive, sequential_greedy, custom, got "annealing"
decision_steps: [4, 8] -> search: {kind: coordinate_ascent, num_restarts: -1}
    22:59: control.search.num_restarts: expected a number of at least 0, got -1
decision_steps: [4, 8] -> search: {kind: sequential_greedy, order: last}
    22:52: control.search.order: expected one of sensor_order, best_first, got "last"
decision_steps: [4, 8] -> search: {kind: cross_entropy, elite_fraction: 1.0}
    22:57: control.search.elite_fraction: expected a number below 1, got 1.0
decision_steps: [4, 8] -> search: {kind: cross_entropy, smoothing: 0.0}
    22:52: control.search.smoothing: expected a number above 0, got 0.0
decision_steps: [4, 8] -> search: {kind: automatic, num_restarts: 2}
    22:37: control.search.num_restarts: expected one of kind, max_joint_actions, got an unknown key
decision_steps: [4, 8] -> constraints: [{kind: distance}]
    22:32: control.constraints[0].kind: expected one of keep_out, max_active, revisit, separation, stay_inside, void_probability, custom, got "distance"
decision_steps: [4, 8] -> constraints: [{distance: 3.0}]
    22:25: control.constraints[0]: expected a mapping with kind: one of keep_out, max_active, revisit, separation, stay_inside, void_probability, custom, got no kind
decision_steps: [4, 8] -> constraints: [{kind: separation, distance: 0.0}]
    22:54: control.constraints[0].distance: expected a number above 0, got 0.0
decision_steps: [4, 8] -> constraints: [{kind: separation}]
    22:25: control.constraints[0].distance: required key is missing
decision_steps: [4, 8] -> constraints: [{kind: keep_out}]
    22:25: control.constraints[0]: expected either region, polygon or geojson, got none
decision_steps: [4, 8] -> constraints: [{kind: keep_out, polygon: [[0, 0], [1, 1]]}]
    22:51: control.constraints[0].polygon: expected a list of at least 3, got a list of 2
decision_steps: [4, 8] -> constraints: [{kind: stay_inside, region: {x_min: 1.0, x_max: 0.0, y_min: 0.0, y_max: 1.0}}]
    22:73: control.constraints[0].region.x_max: expected a number above x_min, 1, got 0.0
decision_steps: [4, 8]
-> constraints: [{kind: separation, distance: 3.0}, {kind: void_probability, radius: 5.0, probability: 2.0}]
    22:111: control.constraints[1].probability: expected a number of at most 1, got 2.0
decision_steps: [4, 8] -> constraints: [{kind: max_active, sensors: 0}]
    22:32: control.constraints[0].kind: expected a sensor that is switchable, for max_active, got none
    22:53: control.constraints[0].sensors: expected a number of at least 1, got 0
decision_steps: [4, 8] -> constraints: [{kind: max_active, sensors: 1}]
    22:32: control.constraints[0].kind: expected a sensor that is switchable, for max_active, got none
decision_steps: [4, 8] -> lookahead: {depth: 0}
    22:30: control.lookahead.depth: expected a number of at least 1, got 0
decision_steps: [4, 8] -> lookahead: {method: forest}
    22:31: control.lookahead.method: expected one of beam, tree, got "forest"
decision_steps: [4, 8] -> lookahead: {method: tree, beam_width: 4}
    22:49: control.lookahead.beam_width: expected none, as it is of method beam, got 4
decision_steps: [4, 8] -> lookahead: {rollout: repeat_last}
    22:32: control.lookahead.rollout: expected none, as it is of method tree, got "repeat_last"
decision_steps: [4, 8] -> lookahead: {period: 1.2}
    22:31: control.lookahead.period: expected a whole multiple of control.horizon_period, 0.5, got 1.2
decision_steps: [4, 8] -> lookahead: {}, association: full, reward: {kind: cauchy_schwarz}
    22:39: control.association: expected known, with a lookahead, got "full"
decision_steps: [4, 8] -> lookahead: {exploration: -1}
    22:36: control.lookahead.exploration: expected a number of at least 0, got -1
"""

# What only some decisions can be made with.
DECISIONS = r"""
{decision_steps: [4, 8]}
-> {decision_steps: [4, 8], constraints: [{kind: void_probability, radius: 5, probability: 0.9}]}
{kind: m_delta_glmb} -> {kind: phd}
{kind: cm_delta_glmb, weights: [0.5, 0.5]} -> {kind: none}
4.0}\n  - {name: south, position: [0.0, -40.0]}\nfilter -> 4.0}\nfilter
estimator: {kind: marginal, threshold: 0.6}\ncontrol -> control
    20:56: control.constraints[0].kind: expected another constraint, as phd filters have no labels to look ahead by, got "void_probability"
{kind: m_delta_glmb} -> {kind: phd}
{kind: cm_delta_glmb, weights: [0.5, 0.5]} -> {kind: none}
4.0}\n  - {name: south, position: [0.0, -40.0]}\nfilter -> 4.0}\nfilter
estimator: {kind: marginal, threshold: 0.6}\ncontrol -> control
heading_deg: 4.0 -> heading_deg: 4.0, scans: {every: 2}
    17:67: sensors[0].scans: expected every step, as phd filters go on from each scan, got only some
"""

# Several at once: all are told, in the order of the file.
TOGETHER = r"""
num_steps: 20 -> num_stps: 20, num_steps: 20
existence: 0.1 -> existence: 2
end_step: 18 -> end_step: 1
std: [0.02, 3.0] -> std: [0.02]
heading_deg: 4.0 -> heading_deg: fast
weights: [0.5, 0.5] -> weights: [0.5, 0.6], mixture_power: cubic
decision_steps: [4, 8] -> decision_steps: [4, 50], num_samples: 0
    2:8: time.num_stps: expected one of num_steps, start, step_period, got an unknown key (did you mean num_steps?)
    9:19: birth.sites[0].existence: expected a number below 1, got 2
    13:63: targets.tracks[0].end_step: expected a step from start_step, 2, on, got 1
    15:32: sensor_defaults.noise.std: expected 2 numbers, as a bearing_range measurement has, got a list of 1
    17:55: sensors[0].heading_deg: expected a number, got "fast"
    20:40: fusion.weights: expected weights with sum 1, got a sum of 1.1
    20:67: fusion.mixture_power: expected one of auto, moment_matched, component_wise, quadrature, got "cubic"
    22:31: control.decision_steps[1]: expected a step up to the last, 20, got 50
    22:49: control.num_samples: expected a number of at least 1, got 0
kind: constant, std -> kind: constant, sdt
    15:3: sensor_defaults.noise.std: required key is missing
    15:27: sensor_defaults.noise.sdt: expected one of kind, std, got an unknown key (did you mean std?)
heading_deg: 4.0 -> noise: {kind: constant, std: [1.0]}
    17:71: sensors[0].noise.std: expected 2 numbers, as a bearing_range measurement has, got a list of 1
name: small -> name: small\nname: large
cutoff: 50.0 -> cutoff: wide
    2:1: name: expected each key once, got it again, after line 1
    24:16: ospa.cutoff: expected a number, got "wide"
heading_deg: 4.0 -> <<: {heading_deg: 4.0}
    17:42: sensors[0].<<: expected one of bias, budget, classification, clutter, compass, correlation, detection, extent, heading_deg, height, measurement, name, noise, platform, position, price, scans, signal, stationary_until_first_decision, switchable, true_parameters, turn, got an unknown key (YAML 1.2 has no merge keys; sensor_defaults holds what sensors share)
kind: constant_velocity, sigma_v: 1.0 -> kind: coordinated_turn
mean: [0.0, 0.0, 0.0, 0.0], std: [5.0, 5.0, 2.0, 2.0] -> mean: [0.0, 0, 0, 0, 0], std: [5.0, 5, 2, 2, 1]
targets:\n  kind: scripted\n  tracks:\n    - {state: [1.0, 2.0, 0.5, -0.5], start_step: 2, end_step: 18}
-> targets:\n  kind: recorded\n  path: nowhere.csv
cutoff: 50.0 -> cutoff: 50.0, components: state
    12:9: targets.path: expected a file, relative to the scenario file, got "nowhere.csv": no such file
    22:34: ospa.components: expected position, as states have 5 components and recorded targets 4, got "state"
"""


def cases(table: str) -> list[tuple[list[str], list[str]]]:
    """Changes and faults of each case."""
    found: list[tuple[list[str], list[str]]] = []
    for line in table.strip("\n").replace("\n-> ", " -> ").splitlines():
        if line.startswith("    "):
            found[-1][1].append(f"f.yaml:{line.strip()}")
        elif found and not found[-1][1]:
            found[-1][0].append(line)
        else:
            found.append(([line], []))
    return found


CASES = [
    case
    for table in (WORLD, SENSORS, TRACKING, NETWORKS, UNDETECTED, CONTROL, DECISIONS, TOGETHER)
    for case in cases(table)
]


@pytest.mark.parametrize(("changes", "faults"), CASES, ids=[changes[-1][:60] for changes, _ in CASES])
def test_errors_are_reported_with_their_locations(changes: list[str], faults: list[str]) -> None:
    pairs = [change.replace("\\n", "\n").split(" -> ") for change in changes]
    with pytest.raises(ScenarioError) as error:
        parse_scenario(changed(*((old, new) for old, new in pairs)), "f.yaml")
    assert error.value.faults == faults
